#include <python/scene_box.h>

#include <planner/costs.h>
#include <planner/figures.h>
#include <planner/planner.h>

#include <fmt/format.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <nlohmann/json.hpp>

namespace palpate::python {

namespace {

// Before each look of the converged solution and each model that is tried: Ctrl-C ends the plan.
void heedSignals(const std::string&)
{
    if (ending()) {
        return;  // the interpreter waits
    }
    const py::gil_scoped_acquire mine;
    if (PyErr_CheckSignals() != 0) {
        throw py::error_already_set();
    }
}

py::object plan(const py::object& what, double error, const std::optional<double>& forceError, double budget, double speed,
                const std::optional<std::filesystem::path>& costs)
{
    refuseIf(!(error > 0 && error <= 1) || (forceError && !(*forceError > 0 && *forceError <= 1)),
             "error, force_error: have to be above 0, and 1 at most: 0.03 is 3 %");
    refuseIf(!(budget > 0 && budget <= 1), "budget: has to be above 0, and 1 s at most");
    refuseIf(!(speed >= planner::minPlanSpeed && speed <= planner::maxPlanSpeed), "speed: has to be ",
             fmt::format("{:g} to {:g} m/s", planner::minPlanSpeed, planner::maxPlanSpeed));
    SceneBox box = sceneOf(what);
    const std::string name = box.scene.name;
    planner::PlanRequest request;
    request.error = error;
    request.forceError = forceError;
    request.budget = budget;
    request.speed = speed;
    if (costs) {
        request.costs = planner::loadCosts(*costs);
    }
    return toPython(asOfScene([&] {
        const Unlocked others;
        box.scene.model.level = datasets::ModelLevel::spring;  // the bodies are made by the planner, one per spacing
        auto tissue = volumeOf(box);
        const auto model = haptics::buildModel(std::move(box.scene), std::move(tissue));
        const auto found = planner::planModel(model, request, &heedSignals);
        return planner::planFigures(name, found, request, costs ? costs->string() : "");
    }));
}

}  // namespace

void bindPlan(py::module_& module)
{
    module.def("plan", &plan, py::arg("scene"), py::kw_only(), py::arg("error") = 0.03, py::arg("force_error") = py::none(),
               py::arg("budget") = 4e-4, py::arg("speed") = 0.02, py::arg("costs") = py::none());
}

}  // namespace palpate::python
