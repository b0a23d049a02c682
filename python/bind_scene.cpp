#include <python/scene_box.h>

#include <base/error.h>
#include <datasets/insert.h>
#include <datasets/scene_text.h>
#include <datasets/tables.h>
#include <haptics/arm.h>
#include <session/open.h>
#ifdef PALPATE_SWEEP
#include <sweep/plan.h>
#endif

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <iterator>
#include <stdexcept>

namespace palpate::python {

namespace {

// The name of a built-in scene or a file, which the argument `name` is.
std::string textOfPath(const py::object& what, const std::string& name)
{
    if (!py::isinstance<py::str>(what) && !py::hasattr(what, "__fspath__")) {
        throw py::type_error(name + ": give a built-in scene's name, a file, or an object of palpate, not " + saidOf(what));
    }
    const py::str text(py::module_::import("os").attr("fspath")(what));
    Py_ssize_t size = 0;
    const char* const utf8 = PyUnicode_AsUTF8AndSize(text.ptr(), &size);
    if (utf8 == nullptr) {
        throw py::error_already_set();  // half a character is a ValueError
    }
    const std::string path{utf8, static_cast<std::size_t>(size)};
    refuseIf(path.find('\0') != std::string::npos, name, ": the name holds a NUL character");
    refuseIf(path.empty(), name, ": is empty: give a built-in scene's name or a file");
    return path;
}

SceneBox parsed(const std::string& text, const std::string& origin)
{
    try {
        return {datasets::parseScene(text, origin), origin, nullptr, false};
    } catch (const std::runtime_error& e) {
        throwSceneError(e.what());
    }
}

#ifdef PALPATE_SWEEP
sweep::KeyValue keyValueOf(const std::string& key, const py::object& value)
{
    refuseMasked(value, key);
    // A scalar of numpy is what its item() is.
    const py::object plain = py::hasattr(value, "item") ? py::object(value.attr("item")()) : value;
    if (py::isinstance<py::bool_>(plain)) {
        return plain.cast<bool>();
    }
    if (py::isinstance<py::int_>(plain)) {
        int overflow = 0;
        const std::int64_t whole = PyLong_AsLongLongAndOverflow(plain.ptr(), &overflow);
        if (overflow != 0) {
            throwSceneError("key '" + key + "': the number is out of range: whole numbers have 63 bits and a sign");
        }
        return whole;
    }
    if (py::isinstance<py::float_>(plain)) {
        return plain.cast<double>();
    }
    if (py::isinstance<py::str>(plain)) {
        return wordOf(plain, key.c_str());
    }
    throw py::type_error("key '" + key + "': give a number, a word, True or False");
}

// What a volume in memory cannot follow: its tissue table is left out.
std::string sourceText(datasets::Scene scene)
{
    scene.tissueChanges.clear();
    return datasets::volumeText(scene);
}

// A box with another scene. A loaded volume that does not follow from it is dropped, so that it is made again; one in
// memory gets the scene's tissue table.
SceneBox withScene(SceneBox box, datasets::Scene scene)
{
    const datasets::Scene before = std::exchange(box.scene, std::move(scene));
    if (!box.volume || datasets::volumeText(before) == datasets::volumeText(box.scene)) {
        return box;
    }
    if (!box.inMemory) {
        box.volume = nullptr;
        return box;
    }
    base::failIf(sourceText(before) != sourceText(box.scene),
                 "volume: the volume of this scene is in memory alone and stays as it is: make another one, or save it "
                 "(Volume.save) and make the scene of that file");
    auto table = datasets::withChanges(box.volume->table(), box.scene.tissueChanges);
    const Unlocked others;
    box.volume = std::make_shared<const volume::Tissue>(datasets::withTable(*box.volume, std::move(table)));
    return box;
}
#endif

// A scene of the tables of a scene file. Files in it are relative to the working folder; an error says neither a file nor a
// line, which there are none of.
SceneBox ofTables(const py::dict& tables)
{
    const auto text = py::module_::import("palpate._toml").attr("dumps")(tables).cast<std::string>();
    const std::string place = (std::filesystem::current_path() / "keywords").string();
    try {
        return {datasets::parseScene(text, place), place, nullptr, false};
    } catch (const std::runtime_error& e) {
        std::string what = e.what();
        if (what.starts_with(place + ":")) {
            what.erase(0, what.find(": ", place.size()) + 2);
        }
        throwSceneError(what);
    }
}

#ifdef PALPATE_SWEEP
bool isTables(const py::object& value)
{
    bool isTables = py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value);
    for (py::size_t i = 0; isTables && i < py::len(value); ++i) {
        isTables = py::isinstance<py::dict>(value[py::int_(i)]);
    }
    return isTables;
}

// A scene with arrays of tables ([[vital]], [[insert]], [[script]]) replaced as a whole.
datasets::Scene withTables(const datasets::Scene& scene, const py::dict& arrays)
{
    auto all = py::dict(py::module_::import("tomllib").attr("loads")(datasets::sceneText(scene)));
    all.attr("update")(arrays);
    return ofTables(all).scene;
}
#endif

SceneBox changed(const SceneBox& box, const py::dict& tables)
{
#ifdef PALPATE_SWEEP
    std::vector<sweep::Setting> settings;
    py::dict arrays;
    for (const auto& [key, value] : flattened(tables)) {
        if (isTables(value) && key.find('.') == std::string::npos) {
            arrays[py::str(key)] = value;
            continue;
        }
        if (isTables(value) && py::len(value) > 0) {
            throwSceneError("key '" + key +
                            "': a list of tables stands at the top of a scene, as vital, insert and script do");
        }
        const bool isVector = py::isinstance<py::array>(value) && py::reinterpret_borrow<py::array>(value).size() != 1;
        if (isVector || py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value)) {
            const Vec3 point = vec3Of(value, key.c_str());
            for (const auto& [axis, coordinate] : {std::pair{".x", point.x}, {".y", point.y}, {".z", point.z}}) {
                settings.push_back({key + axis, coordinate});
            }
        } else {
            settings.push_back({key, keyValueOf(key, value)});
        }
    }
    try {
        return withScene(box, sweep::sceneWith(arrays.empty() ? box.scene : withTables(box.scene, arrays), settings));
    } catch (const std::runtime_error& e) {
        throwSceneError(e.what());
    }
#else
    static_cast<void>(box);
    static_cast<void>(tables);
    throw std::runtime_error("this build has no sweeps (PALPATE_SWEEP), whose keys change scenes");
#endif
}

SceneBox fromKeywords(const py::object& source, const py::kwargs& tables)
{
    if (!source.is_none()) {
        SceneBox box = sceneOf(source, "source");
        return tables.empty() ? box : changed(box, tables);
    }
    return ofTables(tables);
}

SceneBox forVolume(const py::object& what, const std::string& target)
{
    if (!py::isinstance<VolumeBox>(what)) {
        const std::string file = textOfPath(what, "volume");
        auto tissue = std::make_shared<const volume::Tissue>(session::loadVolume(file));
        return {datasets::sceneForVolume(std::filesystem::absolute(file), *tissue, target), file, tissue, false};
    }
    const auto& box = what.cast<VolumeBox&>();
    const bool inMemory = box.file.empty();
    const auto file = std::filesystem::absolute(inMemory ? "volume-in-memory.vdb" : box.file);
    return {datasets::sceneForVolume(file, *box.tissue, target), file.string(), box.tissue, inMemory};
}

py::dict latticeOf(const Modelled& modelled)
{
    const volume::NodeGrid& grid = modelled.model.lattice.grid;
    py::dict out;
    out["shape"] = py::make_tuple(grid.size.x, grid.size.y, grid.size.z);
    out["origin"] = vectorOf(grid.origin);
    out["spacing"] = grid.spacing;
    return out;
}

// The file that holds the very volume of a model; empty: none does.
std::filesystem::path fileOf(const Modelled& modelled)
{
    const datasets::Scene& scene = modelled.model.scene;
    const bool asInFile = scene.source.inserts.empty() && scene.tissueChanges.empty() && !modelled.model.posture;
    return asInFile && !modelled.inMemory ? scene.source.file : std::filesystem::path();
}

void bindModel(py::module_& module)
{
    py::class_<Modelled, std::shared_ptr<Modelled>>(module, "Model")
        .def(py::init([](const py::object& scene) { return std::const_pointer_cast<Modelled>(modelOf(scene)); }),
             py::arg("scene"))
        .def_property_readonly("scene",
                               [](const Modelled& m) {
                                   return SceneBox{m.model.scene, m.info.sceneOrigin, m.given, m.inMemory};
                               })
        .def_property_readonly("volume",
                               [](const Modelled& m) {
                                   auto box = std::make_unique<VolumeBox>();
                                   box->tissue = m.model.tissue;
                                   box->file = fileOf(m);
                                   box->dense = m.dense;
                                   return box;
                               })
        .def_property_readonly("structures", [](const Modelled& modelled) { return modelled.info.structures; })
        .def_property_readonly("tissues", [](const Modelled& m) { return m.info.tissues; })
        .def_property_readonly("entry", [](const Modelled& m) { return vectorOf(m.model.approach.entry); })
        .def_property_readonly("aim", [](const Modelled& m) { return vectorOf(m.model.approach.aim); })
        .def_property_readonly("firing_depth",
                               [](const Modelled& m) {
                                   const auto& line = m.model.approach;
                                   return datasets::firingDepth(m.model.scene.tool, glm::distance(line.entry, line.aim));
                               })
        .def_property_readonly("lattice", latticeOf)
        .def_property_readonly("rate", [](const Modelled& m) { return m.info.rate; })
        .def_property_readonly("hash", [](const Modelled& m) { return m.info.volumeHash; });
}

}  // namespace

std::vector<std::pair<std::string, py::object>> flattened(const py::dict& tables, const std::string& before)
{
    std::vector<std::pair<std::string, py::object>> out;
    for (const auto& [key, value] : tables) {
        const std::string name = before + py::str(key).cast<std::string>();
        if (py::isinstance<py::dict>(value)) {
            std::ranges::move(flattened(py::reinterpret_borrow<py::dict>(value), name + "."), std::back_inserter(out));
        } else {
            out.emplace_back(name, py::reinterpret_borrow<py::object>(value));
        }
    }
    return out;
}

SceneBox sceneNamed(const std::string& what)
{
    try {
        if (auto builtIn = datasets::builtInScene(what)) {
            return {std::move(*builtIn), what, nullptr, false};
        }
        if (std::filesystem::path(what).extension() == ".vdb") {
            return forVolume(py::str(what), "");
        }
        if (!std::filesystem::exists(what)) {
            std::string names;
            for (const std::string& name : datasets::builtInScenes()) {
                names += (names.empty() ? "" : ", ") + name;
            }
            throw std::runtime_error(what + ": no such scene or volume; built-in scenes are: " + names);
        }
        return {datasets::loadScene(what), what, nullptr, false};
    } catch (const std::runtime_error& e) {
        throwSceneError(e.what());
    }
}

SceneBox sceneOf(const py::object& what, const std::string& name)
{
    if (py::isinstance<SceneBox>(what)) {
        return what.cast<SceneBox>();
    }
    if (py::isinstance<VolumeBox>(what)) {
        return forVolume(what, "");
    }
    return sceneNamed(textOfPath(what, name));
}

std::shared_ptr<const volume::Tissue> volumeOf(const SceneBox& box)
{
    return box.volume ? box.volume : std::make_shared<const volume::Tissue>(datasets::sceneVolume(box.scene));
}

std::shared_ptr<const Modelled> modelOf(const py::object& what)
{
    if (py::isinstance<Modelled>(what)) {
        return what.cast<std::shared_ptr<Modelled>>();
    }
    SceneBox box = sceneOf(what);
    return asOfScene([&] {
        const Unlocked others;
        auto tissue = volumeOf(box);
        auto made = std::make_shared<Modelled>(haptics::buildModel(std::move(box.scene), tissue), box.origin);
        made->given = std::move(tissue);
        made->inMemory = box.inMemory;
        return made;
    });
}

void bindScene(py::module_& module)
{
    py::class_<SceneBox>(module, "Scene")
        .def(py::init(&fromKeywords), py::arg("source") = py::none())
        .def_static("parse", &parsed, py::arg("text"), py::arg("origin") = "text")
        .def_static("for_volume", &forVolume, py::arg("volume"), py::arg("target") = "")
        .def("changed", &changed, py::arg("keys"))
        .def("to_dict",
             [](const SceneBox& box) -> py::dict {
                 return py::module_::import("tomllib").attr("loads")(datasets::sceneText(box.scene));
             })
        .def_property_readonly("name", [](const SceneBox& box) { return box.scene.name; })
        .def_property_readonly("text", [](const SceneBox& box) { return datasets::sceneText(box.scene); })
        .def_property_readonly("origin", [](const SceneBox& box) { return textOf(box.origin); })
        .def_property_readonly("target", [](const SceneBox& box) { return box.scene.target; })
        .def("__repr__", [](const SceneBox& box) { return "<palpate.Scene '" + box.scene.name + "'>"; });
    bindModel(module);
    module.def("scenes", &datasets::builtInScenes);
}

}  // namespace palpate::python
