#include <python/live_session.h>
#include <python/scene_box.h>
#include <python/tick_rows.h>

#include <base/error.h>
#include <session/devices.h>
#include <session/figures.h>
#include <volume/direction.h>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include <cmath>
#include <limits>
#include <new>
#include <string_view>

namespace palpate::python {

namespace {

using haptics::DeviceSample;
using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

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

// Numbers as Python's caller gave them, none of which are words.
Doubles doublesOf(const py::handle& given, const char* name, const char* wanted)
{
    // numpy.ma alone adds this to an array. What it hides would be taken for numbers.
    const bool masked = py::isinstance<py::array>(given) && py::hasattr(given, "mask");
    refuseIf(masked, name, ": is a masked array: give a plain one, such as its filled()");
    const auto array = py::array::ensure(given);
    const bool isNumbers = array && std::string_view("biufO").find(array.dtype().kind()) != std::string_view::npos;
    auto numbers = isNumbers ? Doubles::ensure(array) : Doubles();
    if (isNumbers && !numbers && array.dtype().kind() != 'O') {
        throw std::bad_alloc();  // nothing else can go wrong with numbers
    }
    if (!isNumbers || !numbers) {
        PyErr_Clear();
        throw py::value_error(std::string(name) + ": " + wanted);
    }
    return numbers;
}

TickBox step(SessionBox& box, const py::handle& pose, std::uint32_t buttons, bool fresh)
{
    constexpr const char* shapes =
        "give (x, y, z) or (x, y, z, axis x, axis y, axis z), in metres; or these and the six numbers of the probe's move";
    // Of a list numpy makes numbers at once, which is faster, and refuses what is none.
    const auto numbers = py::isinstance<py::array>(pose) ? doublesOf(pose, "pose", shapes) : Doubles::ensure(pose);
    if (!numbers || numbers.ndim() != 1 || !isPoseOf(numbers.shape(0))) {
        PyErr_Clear();
        throw py::value_error(std::string("pose: ") + shapes);
    }
    const LiveSession::Use use(box.live);
    const auto sample = sampleOf(numbers.data(), numbers.shape(0), box.live.axis(), buttons, fresh);
    const py::gil_scoped_release others;
    return {rowOf(box.live.step(sample))};
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

/// What run() and advance() take, as Python's caller gave it.
struct Given {
    const py::object &poses, &buttons, &fresh;
};

std::vector<DeviceSample> samplesOf(const Given& given, Vec3 axis)
{
    constexpr const char* shapes =
        "give an array of n x 3 (positions), n x 6 (and axes) or n x 12 (and the probe's moves), in metres";
    constexpr double buttonBits = std::numeric_limits<std::uint32_t>::max();
    const Doubles poses = doublesOf(given.poses, "poses", shapes);
    refuseIf(poses.ndim() != 2 || !isPoseOf(poses.shape(1)), "poses: ", shapes);
    const py::ssize_t rows = poses.shape(0);
    const Doubles buttons = columnOf(given.buttons, rows, "buttons", buttonBits,
                                     "give sums of DEADMAN, FIRE, MARK and UNMARK, whole numbers below 2**32");
    const Doubles fresh = columnOf(given.fresh, rows, "fresh", 1, "give True or False");
    std::vector<DeviceSample> samples;
    samples.reserve(static_cast<std::size_t>(rows));
    for (py::ssize_t i = 0; i < rows; ++i) {
        const auto pressed = static_cast<std::uint32_t>(buttons.data()[buttons.ndim() == 0 ? 0 : i]);
        const bool isFresh = fresh.data()[fresh.ndim() == 0 ? 0 : i] != 0;
        samples.push_back(sampleOf(poses.data() + i * poses.shape(1), poses.shape(1), axis, pressed, isFresh));
    }
    return samples;
}

// Runs a device to its end, or to a KeyboardInterrupt, which is then set. The session must be in use.
bool runDevice(SessionBox& box, haptics::Device& device, double seconds,
               const std::function<void(const haptics::TickRecord&)>& each)
{
    const py::gil_scoped_release others;
    return box.live.run(device, seconds, each, [] {
        const py::gil_scoped_acquire mine;
        return PyErr_CheckSignals() == 0;
    });
}

// Throws the exception that ended a run. Its rows are made beside it: what runs Python clears an exception that is set.
[[noreturn]] void throwInterrupted(SessionBox& box, const std::function<py::object()>& rows)
{
    {
        const py::error_scope kept;
        box.interrupted = rows();
    }
    throw py::error_already_set();
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
        throw py::error_already_set();
    }
    return samples.size();
}

py::array perform(SessionBox& box, const std::string& trainee, std::uint64_t seed, double seconds)
{
    refuseIf(!(seconds >= 0), "seconds: has to be 0 or more");
    const double rate = box.live.modelled().info.rate;
    base::failIf(rate != 1.0 / haptics::tickSeconds,
                 "perform: the model is of a record at {:g} Hz, and simulated hands move at 1000 Hz: use run()", rate);
    const LiveSession::Use use(box.live);
    session::DeviceRequest request;
    request.trainee = trainee == "script" ? "" : trainee;
    request.seed = seed;
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

py::object ultrasoundOf(SessionBox& box, int width, int height, const py::object& face, const py::object& direction,
                        const py::object& lateral, double depth)
{
    UltrasoundRequest request;
    request.width = width;
    request.height = height;
    request.depth = depth;
    refuseIf(!(depth >= 0), "depth: has to be 0 or more, in metres");
    if (!face.is_none()) {
        const Vec3 at = vec3Of(face, "face");
        refuseIf(!(glm::length(at) <= farthestFace), "face: has to be three numbers in metres, within 10 m");
        const Vec3 inwards = vec3Of(direction, "direction"), along = vec3Of(lateral, "lateral");
        refuseIf(!(glm::length(glm::cross(inwards, along)) > 1e-6 * glm::length(inwards) * glm::length(along)),
                 "direction, lateral: have to be two directions with lengths");
        request.pose = ultrasound::poseOf(at, unit(inwards), unit(along));
    }
    UltrasoundPicture picture;
    {
        const py::gil_scoped_release others;
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

}  // namespace

void bindSession(py::module_& module)
{
    bindConstants(module);
    bindTick(module);
    const auto held = py::arg("buttons") = haptics::buttonDeadMan;
    const auto isFresh = py::arg("fresh") = true;
    py::class_<SessionBox>(module, "Session")
        .def(py::init([](const py::object& scene, const std::optional<std::filesystem::path>& record,
                         const std::string& operatorName) {
                 const auto modelled = modelOf(scene);
                 return std::make_unique<SessionBox>(modelled, record ? record->string() : "", operatorName);
             }),
             py::arg("scene"), py::arg("record") = py::none(), py::arg("operator") = "")
        .def("step", &step, py::arg("pose"), py::arg("buttons") = haptics::buttonDeadMan, py::arg("fresh") = true)
        .def("run", &run, py::arg("poses"), held, isFresh)
        .def("advance", &advance, py::arg("poses"), held, isFresh)
        .def("perform", &perform, py::arg("trainee") = "script", py::arg("seed") = 1, py::arg("seconds") = 120.0)
        .def("close",
             [](SessionBox& box) {
                 const py::gil_scoped_release others;
                 box.live.close();
             })
        .def("__enter__", [](const py::object& self) { return self; })
        .def("__exit__",
             [](SessionBox& box, const py::args&) {
                 const py::gil_scoped_release others;
                 box.live.close();
             })
        .def("score",
             [](SessionBox& box) {
                 const LiveSession::Use use(box.live, Purpose::look);
                 const session::SessionFigures figures = box.live.session().figures();
                 return toPython(session::scoreFigures(figures.score, figures.losses));
             })
        .def("ultrasound", &ultrasoundOf, py::arg("width") = 640, py::arg("height") = 640, py::kw_only(),
             py::arg("face") = py::none(), py::arg("direction") = py::make_tuple(0, 1, 0),
             py::arg("lateral") = py::make_tuple(1, 0, 0), py::arg("depth") = 0.0)
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
