#include <python/convert.h>

#include <base/build.h>
#include <sweep/case.h>
#include <sweep/folder.h>
#include <sweep/pool.h>
#include <sweep/procedure.h>
#include <sweep/run.h>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <optional>

namespace palpate::python {

namespace {

using sweep::SweepFolder;

// Runs what is left of a sweep. It forks, so that only a process of one thread may call it (palpate/_sweep_worker.py).
// `told(done, of)` is called ten times a second; false ends the run after the cases in flight.
std::size_t runSweep(const std::filesystem::path& folder, const std::string& plan, int jobs, bool retry, bool anyBuild,
                     const py::function& told)
{
    const auto alone = sweep::oneThread();
    SweepFolder held(folder, plan, true);
    held.clean();
    const sweep::CasesWanted wanted{sweep::casesOfShard("1/1", held.plan().cases()), retry, anyBuild};
    const auto cases = sweep::remainingCases(held, wanted, [](const std::string&) {});
    const std::size_t all = held.plan().cases(), before = all - cases.size();
    // An interrupt may come while Python reports: the cases in flight are finished and the tables written in any case.
    std::optional<py::error_already_set> stopped;
    const auto keepGoing = [&](std::size_t done, std::size_t) {
        held.lock().check();
        if (stopped) {
            return false;
        }
        try {
            if (PyErr_CheckSignals() != 0) {
                throw py::error_already_set();
            }
            return told(before + done, all).cast<bool>();
        } catch (const py::error_already_set& error) {
            stopped = error;
            return false;
        }
    };
    if (!cases.empty()) {
        sweep::runLocally(held, cases, jobs, std::string(base::build()), keepGoing, [] { return false; });
    }
    const std::size_t rows = sweep::writeTables(held, held.rows()).rows.size();
    if (stopped) {
        throw *stopped;
    }
    return rows;
}

py::dict outputs()
{
    py::dict out;
    for (std::size_t kind = 0; kind < sweep::procedureNames.size(); ++kind) {
        py::dict one;
        for (const auto& info : sweep::outputsOf(static_cast<sweep::ProcedureKind>(kind))) {
            one[py::str(info.name)] = info.meaning;
        }
        out[py::str(std::string(sweep::procedureNames[kind]))] = one;
    }
    return out;
}

}  // namespace

void bindSweep(py::module_& module)
{
    module.def("run_sweep", &runSweep, py::arg("folder"), py::arg("plan"), py::arg("jobs"), py::arg("retry"),
               py::arg("any_build"), py::arg("told"));
    module.def("sweep_outputs", &outputs);
    module.def(
        "merge_shards",
        [](const std::filesystem::path& folder, const std::vector<std::filesystem::path>& shards, bool anyBuild) {
            sweep::mergeShards(folder, shards, anyBuild);
            const SweepFolder merged(folder, "", true);
            sweep::writeTables(merged, merged.rows());
        },
        py::arg("folder"), py::arg("shards"), py::arg("any_build"));
}

}  // namespace palpate::python
