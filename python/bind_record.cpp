#include <python/scene_box.h>
#include <python/tick_rows.h>

#include <base/build.h>
#include <haptics/record_check.h>
#include <haptics/replay.h>
#include <session/figures.h>
#include <session/open.h>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <nlohmann/json.hpp>

#include <mutex>

namespace palpate::python {

namespace {

struct RecordBox {
    explicit RecordBox(const std::filesystem::path& from) : file(from.string()), record(from) {}

    std::string file;
    haptics::Record record;
    mutable std::mutex guard;  // of the record, which is one connection to its file
};

// Works with the record while no other thread does, and without Python's lock: who waits stops nobody else.
template <class Work>
auto alone(const RecordBox& box, Work&& work)
{
    const Unlocked others;
    const std::lock_guard mine(box.guard);
    return work();
}

py::tuple readTicks(const RecordBox& box)
{
    std::vector<TickRow> rows;
    std::vector<EventRow> happened;
    alone(box, [&] {
        rows.reserve(box.record.ticks());
        box.record.each([&](const haptics::TickRecord& tick) {
            rows.push_back(rowOf(tick));
            for (std::uint32_t i = 0; i < tick.eventCount; ++i) {
                happened.push_back(rowOf(tick.tick, tick.events[i]));
            }
        });
    });
    py::array ticks = rowsOf(tickType(box.record.info().structures.size()), rows.size());
    std::copy(rows.begin(), rows.end(), static_cast<TickRow*>(ticks.mutable_data()));
    py::array events = rowsOf(eventType(), happened.size());
    std::copy(happened.begin(), happened.end(), static_cast<EventRow*>(events.mutable_data()));
    return py::make_tuple(ticks, events);
}

py::dict infoOf(const RecordBox& box)
{
    const haptics::SessionInfo& info = box.record.info();
    py::dict out;
    out["scene"] = info.scene;
    out["scene_origin"] = textOf(info.sceneOrigin);
    out["model"] = info.model;
    out["device"] = info.device;
    out["build"] = info.build;
    out["operator"] = info.operatorName;
    out["host"] = info.host;
    out["started"] = info.started;
    out["rate"] = info.rate;
    out["seed"] = info.seed;
    out["structures"] = info.structures;
    out["tissues"] = info.tissues;
    return out;
}

py::dict replay(const RecordBox& box)
{
    const haptics::ReplayResult result =
        alone(box, [&] { return haptics::replay(box.record, session::reopenSession(box.file, box.record.info())); });
    py::dict out;
    out["ticks"] = result.ticks;
    out["identical"] = result.identical;
    out["first_difference_tick"] = result.firstDifference ? py::object(py::int_(*result.firstDifference)) : py::none();
    out["largest_difference_n"] = result.largestDifference;
    out["force_hash"] = session::hexadecimal(result.forceHash);
    out["differences"] = result.inWords;
    return out;
}

py::dict score(const RecordBox& box)
{
    haptics::Score found;
    std::vector<haptics::Loss> losses;
    haptics::RecordCheck check;
    alone(box, [&] {
        found = haptics::scoreOf(box.record);
        losses = haptics::lossesOf(box.record);
        check = haptics::checkRecord(box.record, base::build());
    });
    py::dict out = toPython(session::scoreFigures(found, losses));
    out["doubts"] = check.warnings;
    return out;
}

py::dict resultsOf(const RecordBox& box)
{
    py::dict out;
    for (const auto& [key, value] : alone(box, [&] { return box.record.results(); })) {
        out[py::str(key)] = value;
    }
    return out;
}

std::shared_ptr<Modelled> modelOfRecord(const RecordBox& box)
{
    const Unlocked others;
    auto made =
        std::make_shared<Modelled>(session::reopenSession(box.file, box.record.info()), box.record.info().sceneOrigin);
    made->info.rate = box.record.info().rate;
    made->given = made->model.posture ? nullptr : made->model.tissue;
    return made;
}

}  // namespace

void bindRecord(py::module_& module)
{
    py::class_<RecordBox>(module, "RecordFile")
        .def(py::init([](const py::object& file) {
                 const auto from = pathOf(file, "file");
                 refuseIf(from.empty(), "file: is empty: give the record of a session");
                 return std::make_unique<RecordBox>(from);
             }),
             py::arg("file"))
        .def_property_readonly("file", [](const RecordBox& box) { return textOf(box.file); })
        .def_property_readonly("info", &infoOf)
        .def_property_readonly("scene_text", [](const RecordBox& box) { return box.record.info().sceneText; })
        .def_property_readonly("complete",
                               [](const RecordBox& box) { return alone(box, [&] { return box.record.complete(); }); })
        .def_property_readonly("results", &resultsOf)
        .def("read_ticks", &readTicks)
        .def("replay", &replay)
        .def("score", &score)
        .def("model", &modelOfRecord);
}

}  // namespace palpate::python
