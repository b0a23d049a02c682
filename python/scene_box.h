#pragma once

// Scenes and volumes as Python holds them.

#include <datasets/scene.h>
#include <python/convert.h>
#include <python/dense_grids.h>
#include <python/live_session.h>
#include <volume/tissue.h>

#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace palpate::python {

/// A volume and the dense copies of its grids.
struct VolumeBox {
    std::shared_ptr<const volume::Tissue> tissue;
    std::filesystem::path file;  // that it was read from or saved to; empty: it is in memory alone
    std::shared_ptr<DenseGrids> dense = std::make_shared<DenseGrids>();
};

/// A scene, and what its text came from.
struct SceneBox {
    datasets::Scene scene;
    std::string origin;
    std::shared_ptr<const volume::Tissue> volume;  // loaded already; null: not
    bool inMemory = false;                         // its volume is in no file
};

/// A scene by built-in name, TOML file or volume (.vdb). Throws palpate.SceneError.
SceneBox sceneNamed(const std::string& what);
/// The scene that the argument `name` of Python means: a Scene, a Volume, a name or a path. Throws TypeError that names it.
SceneBox sceneOf(const py::object& what, const std::string& name = "scene");
/// Its volume, made where it is not loaded. Needs no GIL.
std::shared_ptr<const volume::Tissue> volumeOf(const SceneBox& box);
/// `work()`, which makes a volume or a model; its errors are throwModelError's.
template <class Work>
auto asOfScene(const Work& work)
{
    try {
        return work();
    } catch (const py::builtin_exception&) {
        throw;
    } catch (const std::runtime_error& e) {
        throwModelError(e.what());
    }
}
/// The model that it means: a Model, or one that is built now, with the GIL released.
std::shared_ptr<const Modelled> modelOf(const py::object& what);
/// [(key, value)] of nested dictionaries, keys joined by dots.
std::vector<std::pair<std::string, py::object>> flattened(const py::dict& tables, const std::string& before = "");

}  // namespace palpate::python
