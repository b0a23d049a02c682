#pragma once

#include <haptics/session_model.h>
#include <studies/kernel/kernel_rivals.h>
#include <studies/kernel/kernel_work.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace palpate::studies {

/// What the windows are compared with, in the same trial.
struct KernelRivals {
    FullSolve full;
    std::vector<RivalRun> singleGrids;
    TrialResult chainMail, nothing;
    TrialResult standing;  // the setting itself, but every tick begins where the tissue lies, not with the last increment
};

/// One trial of one setting.
struct KernelCase {
    std::string scene, tool, setting;
    double speed = 0;    // [m/s]
    double spacing = 0;  // of the finest nodes [m]
    int window = 0;
    int cycles = 0;
    std::size_t nodes = 0;      // of the windows
    std::size_t fullNodes = 0;  // of the whole grid
    double strain = 0;          // largest that the reference sees, see ReferenceState
    double residual = 0;        // of the reference, fraction of the contacts' forces
    TrialResult result;
    std::vector<KernelWork> work;  // of the solver, per tick in contact
    std::optional<KernelRivals> rivals;
};

struct KernelRequest {
    std::vector<std::string> settings;  // of datasets::elasticSettings()
    std::vector<TrialTool> tools;
    std::vector<double> speeds;  // [m/s]
    std::string rivalsOf;        // the setting that the rivals are measured for, at the first speed
    int rivalCycles = 4;         // of single grids, at most
};

/// Where the benchmark is.
using KernelProgress = std::function<void(const std::string& what)>;
using KernelSink = std::function<void(const KernelCase&)>;

/// All trials in one scene, one after the other; each goes to `sink` when it is done. Throws std::runtime_error.
void benchKernel(const haptics::SessionModel& model, const KernelRequest& request, const KernelProgress& progress,
                 const KernelSink& sink);

}  // namespace palpate::studies
