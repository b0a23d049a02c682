#include <python/live_session.h>
#include <python/scene_box.h>
#include <python/tick_rows.h>

#include <base/error.h>
#include <base/outputs.h>
#include <haptics/record_bounds.h>
#include <haptics/trainee.h>
#include <session/devices.h>
#include <session/figures.h>
#include <volume/direction.h>

#include <fmt/ranges.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::python {

namespace {

using haptics::DeviceSample;

/// A session, what of it is made when first asked for, and what an interrupted run has done.
struct SessionBox {
    SessionBox(std::shared_ptr<const Modelled> modelled, const std::string& record, const std::string& operatorName)
        : live(std::move(modelled), record, operatorName)
    {
    }

    LiveSession live;
    std::unique_ptr<LiveUltrasound> ultrasound;
    py::object interrupted = py::none();  // rows of the ticks that were done
};

/// One tick as step() gives it.
struct TickBox {
    TickRow row;
};

// As given where it is a unit vector to the last bits, so that a record's poses stay what they are.
Vec3 unit(Vec3 axis)
{
    axis = volume::rescaled(axis);
    const double length = glm::length(axis);
    refuseIf(!(length > 0) || !std::isfinite(length), "pose: the axis has no length");
    return std::abs(length - 1) < 1e-12 ? axis : axis / length;
}

constexpr double farthestFace = 10.0;  // of an ultrasound probe [m]
constexpr py::ssize_t withProbe = 12;  // numbers of a pose that has the probe's move, too

bool isPoseOf(py::ssize_t numbers)
{
    return numbers == 3 || numbers == 6 || numbers == withProbe;
}

DeviceSample sampleOf(const double* pose, py::ssize_t numbers, Vec3 axis, std::uint32_t buttons, bool fresh)
{
    DeviceSample sample;
    sample.position = {pose[0], pose[1], pose[2]};
    sample.axis = numbers >= 6 ? unit({pose[3], pose[4], pose[5]}) : axis;
    if (numbers == withProbe) {
        sample.probe = {pose[6], pose[7], pose[8], pose[9], pose[10], pose[11]};
    }
    sample.buttons = buttons;
    sample.fresh = fresh;
    return sample;
}

// Whole numbers from 0 to `most`, one or `rows` of them.
Doubles columnOf(const py::object& given, py::ssize_t rows, const char* name, double most, const char* wanted)
{
    auto column = doublesOf(given, name, wanted);
    if (column.ndim() > 1 || (column.ndim() == 1 && column.shape(0) != rows)) {
        throw py::value_error(std::string(name) + ": give one value, or one for each of the " + std::to_string(rows) +
                              " poses");
    }
    for (py::ssize_t i = 0; i < column.size(); ++i) {
        const double value = column.data()[i];
        refuseIf(!(value >= 0 && value <= most && value == std::floor(value)), name, ": ", wanted);
    }
    return column;
}

constexpr double buttonBits = std::numeric_limits<std::uint32_t>::max();
constexpr const char* buttonsWanted = "give sums of DEADMAN, FIRE, MARK and UNMARK, whole numbers below 2**32";
constexpr const char* freshWanted = "give True or False";

// One of them, which is mostly an int.
double oneOf(const py::object& given, const char* name, double most, const char* wanted)
{
    if (PyLong_CheckExact(given.ptr()) || PyBool_Check(given.ptr())) {
        int overflow = 0;
        const auto value = static_cast<double>(PyLong_AsLongLongAndOverflow(given.ptr(), &overflow));
        refuseIf(overflow != 0 || !(value >= 0 && value <= most), name, ": ", wanted);
        return value;
    }
    return columnOf(given, 1, name, most, wanted).data()[0];
}

TickBox step(SessionBox& box, const py::object& pose, const py::object& buttons, const py::object& fresh)
{
    constexpr const char* shapes =
        "give (x, y, z) or (x, y, z, axis x, axis y, axis z), in metres; or these and the six numbers of the probe's move";
    const auto numbers = doublesOf(pose, "pose", shapes);
    refuseIf(numbers.ndim() != 1 || !isPoseOf(numbers.shape(0)), "pose: ", shapes);
    const auto pressed = static_cast<std::uint32_t>(oneOf(buttons, "buttons", buttonBits, buttonsWanted));
    const bool isFresh = oneOf(fresh, "fresh", 1, freshWanted) != 0;
    const LiveSession::Use use(box.live);
    const auto sample = sampleOf(numbers.data(), numbers.shape(0), box.live.axis(), pressed, isFresh);
    const Unlocked others;
    return {rowOf(box.live.step(sample))};
}

/// What run() and advance() take, as Python's caller gave it.
struct Given {
    const py::object &poses, &buttons, &fresh;
};

std::vector<DeviceSample> samplesOf(const Given& given, Vec3 axis)
{
    constexpr const char* shapes =
        "give an array of n x 3 (positions), n x 6 (and axes) or n x 12 (and the probe's moves), in metres";
    const Doubles poses = doublesOf(given.poses, "poses", shapes);
    refuseIf(poses.ndim() != 2 || !isPoseOf(poses.shape(1)), "poses: ", shapes);
    const py::ssize_t rows = poses.shape(0);
    const Doubles buttons = columnOf(given.buttons, rows, "buttons", buttonBits, buttonsWanted);
    const Doubles fresh = columnOf(given.fresh, rows, "fresh", 1, freshWanted);
    std::vector<DeviceSample> samples;
    samples.reserve(static_cast<std::size_t>(rows));
    for (py::ssize_t i = 0; i < rows; ++i) {
        const auto pressed = static_cast<std::uint32_t>(buttons.data()[buttons.ndim() == 0 ? 0 : i]);
        const bool isFresh = fresh.data()[fresh.ndim() == 0 ? 0 : i] != 0;
        samples.push_back(sampleOf(poses.data() + i * poses.shape(1), poses.shape(1), axis, pressed, isFresh));
    }
    return samples;
}

// Runs a device to its end, or to an exception, such as KeyboardInterrupt, which is then set. The session must be in use.
bool runDevice(SessionBox& box, haptics::Device& device, double seconds,
               const std::function<void(const haptics::TickRecord&)>& each)
{
    box.interrupted = py::none();
    const Unlocked others;
    return box.live.run(device, seconds, each, [] {
        if (ending()) {
            return false;
        }
        const py::gil_scoped_acquire mine;
        return PyErr_CheckSignals() == 0;
    });
}

// Throws the exception that stopped a run.
[[noreturn]] void throwStopped()
{
    if (PyErr_Occurred() == nullptr) {
        throwEnding();
    }
    throw py::error_already_set();
}

// The same. Its rows are made beside it: what runs Python clears an exception that is set.
[[noreturn]] void throwInterrupted(SessionBox& box, const std::function<py::object()>& rows)
{
    {
        const py::error_scope kept;
        box.interrupted = rows();
    }
    throwStopped();
}

py::array run(SessionBox& box, const py::object& poses, const py::object& buttons, const py::object& fresh)
{
    const LiveSession::Use use(box.live);
    const auto samples = samplesOf({poses, buttons, fresh}, box.live.axis());
    py::array out = rowsOf(tickType(box.live.modelled().info.structures.size()), samples.size());
    auto* const rows = static_cast<TickRow*>(out.mutable_data());
    std::size_t done = 0;
    PosesDevice device(samples);
    if (!runDevice(box, device, 0, [&](const haptics::TickRecord& tick) { rows[done++] = rowOf(tick); })) {
        throwInterrupted(box, [&] { return out[py::slice(0, static_cast<py::ssize_t>(done), 1)]; });
    }
    return out;
}

std::size_t advance(SessionBox& box, const py::object& poses, const py::object& buttons, const py::object& fresh)
{
    const LiveSession::Use use(box.live);
    const auto samples = samplesOf({poses, buttons, fresh}, box.live.axis());
    PosesDevice device(samples);
    if (!runDevice(box, device, 0, {})) {
        throwStopped();
    }
    return samples.size();
}

py::array perform(SessionBox& box, const std::string& trainee, const py::object& seed, double seconds)
{
    refuseIf(!(seconds >= 0), "seconds: has to be 0 or more");
    const double rate = box.live.modelled().info.rate;
    base::failIf(rate != 1.0 / haptics::tickSeconds,
                 "perform: the model is of a record at {:g} Hz, and simulated hands move at 1000 Hz: use run()", rate);
    const LiveSession::Use use(box.live);
    const std::vector<std::string> skills = haptics::skillNames();
    base::failIf(trainee != "script" && std::ranges::find(skills, trainee) == skills.end(),
                 "trainee '{}': there are script, {}", trainee, fmt::join(skills, ", "));
    session::DeviceRequest request;
    request.trainee = trainee == "script" ? "" : trainee;
    request.seed = seedOf(seed, "seed");
    const auto device = session::openDevice(box.live.modelled().model, request, nullptr);
    std::vector<TickRow> rows;
    const bool whole =
        runDevice(box, *device, seconds, [&](const haptics::TickRecord& tick) { rows.push_back(rowOf(tick)); });
    const auto all = [&] {
        py::array out = rowsOf(tickType(box.live.modelled().info.structures.size()), rows.size());
        std::copy(rows.begin(), rows.end(), static_cast<TickRow*>(out.mutable_data()));
        return out;
    };
    if (!whole) {
        throwInterrupted(box, all);
    }
    return all();
}

using Purpose = LiveSession::Purpose;

py::array eventsOf(SessionBox& box)
{
    const LiveSession::Use use(box.live, Purpose::look);
    py::array out = rowsOf(eventType(), box.live.events().size());
    auto* row = static_cast<EventRow*>(out.mutable_data());
    for (const auto& [tick, event] : box.live.events()) {
        *row++ = rowOf(tick, event);
    }
    return out;
}

// Nodes lie x fastest, so that index (i, j, k, axis) has strides of 1, nx and nx ny nodes.
py::array displacementOf(const py::object& self)
{
    auto& box = self.cast<SessionBox&>();
    const LiveSession::Use use(box.live, Purpose::look);
    const chainmail::DisplacedLattice& shape = box.live.session().simulation().shape();
    const Index3 size = shape.lattice().grid.size;
    const py::ssize_t node = sizeof(Vec3f), row = node * size.x, slice = row * size.y;
    return readOnlyView(py::dtype::of<float>(), {size.x, size.y, size.z, 3}, {node, row, slice, sizeof(float)},
                        shape.u().data(), self);
}

py::list coresOf(SessionBox& box)
{
    const LiveSession::Use use(box.live, Purpose::look);
    py::list out;
    for (const haptics::CoreSample& core : box.live.session().figures().cores) {
        py::dict fractions, one;
        for (std::size_t i = 0; i < box.live.modelled().info.tissues.size(); ++i) {
            if (core.fraction[i] > 0) {
                fractions[py::str(box.live.modelled().info.tissues[i])] = core.fraction[i];
            }
        }
        one["fraction"] = fractions;
        one["volume"] = core.volume;
        one["target_fraction"] = core.targetFraction;
        one["target_length"] = core.targetLength;
        one["fragments"] = core.fragments;
        one["notch_start"] = vectorOf(core.notchStart);
        one["notch_end"] = vectorOf(core.notchEnd);
        out.append(one);
    }
    return out;
}

// Where the caller has the probe; nothing: where the scene has it.
std::optional<ultrasound::Pose> poseOfProbe(const py::object& face, const py::object& direction, const py::object& lateral)
{
    if (face.is_none()) {
        refuseIf(!direction.is_none() || !lateral.is_none(),
                 "direction, lateral: need the place of the probe: give face too");
        return std::nullopt;
    }
    const Vec3 at = vec3Of(face, "face");
    refuseIf(!(glm::length(at) <= farthestFace), "face: has to be three numbers in metres, within 10 m");
    const Vec3 inwards = direction.is_none() ? Vec3(0, 1, 0) : vec3Of(direction, "direction");
    const Vec3 along = lateral.is_none() ? Vec3(1, 0, 0) : vec3Of(lateral, "lateral");
    refuseIf(!(glm::length(glm::cross(inwards, along)) > 1e-6 * glm::length(inwards) * glm::length(along)),
             "direction, lateral: have to be two directions with lengths");
    return ultrasound::poseOf(at, unit(inwards), unit(along));
}

py::object ultrasoundOf(SessionBox& box, int width, int height, const py::object& face, const py::object& direction,
                        const py::object& lateral, double depth)
{
    UltrasoundRequest request;
    request.width = width;
    request.height = height;
    request.depth = depth;
    refuseIf(!(depth >= 0), "depth: has to be 0 or more, in metres");
    request.pose = poseOfProbe(face, direction, lateral);
    UltrasoundPicture picture;
    {
        const Unlocked others;
        const LiveSession::Use use(box.live);
        if (!box.ultrasound) {
            box.ultrasound = std::make_unique<LiveUltrasound>(box.live.modelled().model);
        }
        picture = box.ultrasound->picture(box.live.session().simulation(), box.live.shown(), request);
    }
    py::array_t<std::uint8_t> pixels({picture.pixels.height, picture.pixels.width});
    std::copy(picture.pixels.grey.begin(), picture.pixels.grey.end(), pixels.mutable_data());
    py::array_t<std::uint8_t> lines({picture.image.settings.samples, picture.image.settings.lines});
    std::copy(picture.image.grey.begin(), picture.image.grey.end(), lines.mutable_data());
    py::dict out;
    out["pixels"] = pixels;
    out["lines"] = lines;
    out["metres_per_pixel"] = picture.metresPerPixel;
    const ultrasound::Transducer& probe = picture.image.transducer;
    out["top"] = picture.top;
    out["line_pitch"] = picture.pitch;
    out["radius"] = probe.shape == ultrasound::ProbeShape::curved ? probe.radius : 0.0F;
    out["depth"] = picture.image.settings.depth;
    out["frequency"] = picture.image.settings.frequency;
    out["face"] = vectorOf(picture.image.pose.face);
    out["direction"] = vectorOf(picture.image.pose.axial);
    out["lateral"] = vectorOf(picture.image.pose.lateral);
    out["tick"] = picture.image.tick;
    return out;
}

template <class T>
py::object vectorField(const std::array<T, 3>& v)
{
    return vectorOf({v[0], v[1], v[2]});
}

template <std::size_t n>
py::array_t<double> numbersOf(const std::array<double, n>& values)
{
    return py::array_t<double>(n, values.data());
}

void bindTick(py::module_& module)
{
    py::class_<TickBox>(module, "Tick")
        .def_property_readonly("tick", [](const TickBox& t) { return t.row.tick; })
        .def_property_readonly("position", [](const TickBox& t) { return vectorField(t.row.position); })
        .def_property_readonly("axis", [](const TickBox& t) { return vectorField(t.row.axis); })
        .def_property_readonly("buttons", [](const TickBox& t) { return t.row.buttons; })
        .def_property_readonly("fresh", [](const TickBox& t) { return t.row.fresh != 0; })
        .def_property_readonly("proxy", [](const TickBox& t) { return vectorField(t.row.proxy); })
        .def_property_readonly("tissue_force", [](const TickBox& t) { return vectorField(t.row.tissueForce); })
        .def_property_readonly("basic", [](const TickBox& t) { return vectorField(t.row.basic); })
        .def_property_readonly("additional", [](const TickBox& t) { return vectorField(t.row.additional); })
        .def_property_readonly("total", [](const TickBox& t) { return vectorField(t.row.total); })
        .def_property_readonly("energy", [](const TickBox& t) { return t.row.energy; })
        .def_property_readonly("damped", [](const TickBox& t) { return t.row.damped; })
        .def_property_readonly("deflection", [](const TickBox& t) { return vectorField(t.row.deflection); })
        .def_property_readonly("phase", [](const TickBox& t) { return haptics::phaseNames[t.row.phase]; })
        .def_property_readonly("warning", [](const TickBox& t) { return haptics::warningNames[t.row.warning]; })
        .def_property_readonly("tissue", [](const TickBox& t) { return t.row.tissue; })
        .def_property_readonly("inserted", [](const TickBox& t) { return t.row.inserted; })
        .def_property_readonly("needle_in_beam", [](const TickBox& t) { return t.row.needleInBeam; })
        .def_property_readonly("tip_in_beam", [](const TickBox& t) { return t.row.tipInBeam != 0; })
        .def_property_readonly("contacts", [](const TickBox& t) { return t.row.contacts; })
        .def_property_readonly("penetration", [](const TickBox& t) { return t.row.penetration; })
        .def_property_readonly("moved", [](const TickBox& t) { return t.row.moved; })
        .def_property_readonly("residual", [](const TickBox& t) { return t.row.residual; })
        .def_property_readonly("ahead", [](const TickBox& t) { return t.row.ahead; })
        .def_property_readonly("ahead_tissue", [](const TickBox& t) { return t.row.aheadTissue; })
        .def_property_readonly("ahead_speed", [](const TickBox& t) { return t.row.aheadSpeed; })
        .def_property_readonly("distance_to_target", [](const TickBox& t) { return t.row.distance[0]; })
        .def_property_readonly("nearest_vital", [](const TickBox& t) { return t.row.nearestVital; })
        .def_property_readonly("warned", [](const TickBox& t) { return t.row.warned; })
        .def_property_readonly("probe_move", [](const TickBox& t) { return numbersOf(t.row.probeMove); })
        .def_property_readonly("probe_face", [](const TickBox& t) { return vectorField(t.row.probeFace); })
        .def_property_readonly("probe_axis", [](const TickBox& t) { return vectorField(t.row.probeAxis); })
        .def_property_readonly("probe_lateral", [](const TickBox& t) { return vectorField(t.row.probeLateral); })
        .def_property_readonly("probe_force", [](const TickBox& t) { return vectorField(t.row.probeForce); })
        .def_property_readonly("distance", [](const TickBox& t) { return numbersOf(t.row.distance); })
        .def_property_readonly("ahead_distance", [](const TickBox& t) { return numbersOf(t.row.aheadDistance); })
        .def_property_readonly("events", [](const TickBox& t) { return t.row.events; })
        .def_property_readonly("fired", [](const TickBox& t) { return t.row.fired != 0; })
        .def_property_readonly("faulted", [](const TickBox& t) { return t.row.faulted != 0; });
}

void bindConstants(py::module_& module)
{
    module.attr("DEADMAN") = haptics::buttonDeadMan;
    module.attr("FIRE") = haptics::buttonFire;
    module.attr("MARK") = haptics::buttonMark;
    module.attr("UNMARK") = haptics::buttonUnmark;
    module.attr("EVENTS") = py::tuple(py::cast(haptics::eventNames));
    module.attr("PHASES") = py::tuple(py::cast(haptics::phaseNames));
    module.attr("WARNINGS") = py::tuple(py::cast(haptics::warningNames));
    module.attr("TICK_SECONDS") = haptics::tickSeconds;
}

// As a recorder does, also where there is none: whoever adds a record finds the same names good.
void checkOperator(const std::string& name)
{
    haptics::SessionInfo info;
    info.operatorName = name;
    try {
        haptics::format::checkInfo(info);
    } catch (const std::runtime_error& e) {
        throw py::value_error(std::string("operator: ") + e.what());
    }
}

}  // namespace

void bindSession(py::module_& module)
{
    bindConstants(module);
    bindTick(module);
    const auto held = py::arg("buttons") = haptics::buttonDeadMan;
    const auto isFresh = py::arg("fresh") = true;
    py::class_<SessionBox>(module, "Session")
        .def(py::init([](const py::object& scene, const py::object& record, const py::object& operatorName) {
                 const std::string file = record.is_none() ? "" : pathOf(record, "record").string();
                 refuseIf(file.empty() && !record.is_none(), "record: is empty: give a file, or None for no record");
                 base::checkOutput(file);
                 const std::string name = wordOf(operatorName, "operator");
                 checkOperator(name);
                 return std::make_unique<SessionBox>(modelOf(scene), file, name);
             }),
             py::arg("scene"), py::arg("record") = py::none(), py::arg("operator") = "")
        .def("step", &step, py::arg("pose"), py::arg("buttons") = haptics::buttonDeadMan, py::arg("fresh") = true)
        .def("run", &run, py::arg("poses"), held, isFresh)
        .def("advance", &advance, py::arg("poses"), held, isFresh)
        .def("perform", &perform, py::arg("trainee") = "script", py::arg("seed") = 1, py::arg("seconds") = 120.0)
        .def("close",
             [](SessionBox& box) {
                 const Unlocked others;
                 box.live.close();
             })
        .def("__enter__", [](const py::object& self) { return self; })
        .def("__exit__",
             [](SessionBox& box, const py::args&) {
                 const Unlocked others;
                 box.live.close();
             })
        .def("score",
             [](SessionBox& box) {
                 const LiveSession::Use use(box.live, Purpose::look);
                 const session::SessionFigures figures = box.live.session().figures();
                 return toPython(session::scoreFigures(figures.score, figures.losses));
             })
        .def("ultrasound", &ultrasoundOf, py::arg("width") = 640, py::arg("height") = 640, py::kw_only(),
             py::arg("face") = py::none(), py::arg("direction") = py::none(), py::arg("lateral") = py::none(),
             py::arg("depth") = 0.0)
        .def_property_readonly("events", &eventsOf)
        .def_property_readonly("cores", &coresOf)
        .def_property_readonly("displacement", &displacementOf)
        .def_property_readonly("interrupted", [](const SessionBox& box) { return box.interrupted; })
        .def_property_readonly("model",
                               [](const SessionBox& box) { return std::const_pointer_cast<Modelled>(box.live.shared()); })
        .def_property_readonly("ticks", [](const SessionBox& box) { return box.live.ticks(); })
        .def_property_readonly("closed", [](const SessionBox& box) { return box.live.closed(); })
        .def_property_readonly("force_hash", [](SessionBox& box) {
            const LiveSession::Use use(box.live, Purpose::look);
            return session::hexadecimal(box.live.session().figures().forceHash);
        });
}

}  // namespace palpate::python
