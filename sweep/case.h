#pragma once

#include <haptics/recorder.h>
#include <haptics/session_model.h>
#include <sweep/plan.h>

#include <chrono>
#include <filesystem>
#include <list>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace palpate::sweep {

/// What a case came to.
struct CaseRow {
    std::vector<double> outputs;  // by SweepPlan::outputs; not finite: none
    double tickTime = 0;          // mean processor time of a tick in contact [s]; a timing, other on every run
};

/// A record that could not be written: no fault of the case.
struct RecordFailed : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// Runs cases of a plan one after the other. What it keeps from one for the next (volumes, models, results of reference
/// cases) changes no row: a case's outputs follow from the plan and its number alone.
class CaseRunner {
public:
    /// `build` goes into records. The plan must outlive it.
    CaseRunner(const SweepPlan& plan, std::string build);
    ~CaseRunner();

    /// @param index   of the case    @param record  file for a record of the session; empty: none
    /// Throws std::runtime_error when the case's scene cannot be built.
    CaseRow run(std::size_t index, const std::filesystem::path& record = {});

private:
    struct Measured {
        std::vector<double> values;  // by outputsOf()
        double tickTime = 0;
    };

    // A model and what a score and a record say of it.
    struct Modelled {
        haptics::SessionModel model;
        haptics::SessionInfo info;
    };

    std::shared_ptr<const Modelled> modelOf(const datasets::Scene& scene);
    std::shared_ptr<const volume::Tissue> volumeOf(const datasets::Scene& scene);
    const Measured& referenceOf(const SweepCase& c);
    Measured measure(const datasets::Scene& scene, const Procedure& procedure, std::uint64_t seed,
                     const std::filesystem::path& record);

    const SweepPlan& plan_;
    std::string build_;
    std::chrono::steady_clock::time_point began_;  // of the case: its models and its reference are parts of it
    // By the text that they follow from, the last used first.
    std::list<std::pair<std::string, std::shared_ptr<const Modelled>>> models_;
    std::list<std::pair<std::string, std::shared_ptr<const volume::Tissue>>> volumes_;
    std::list<std::pair<std::string, Measured>> references_;
};

/// While it lives the process's libraries work in one thread. Before the first of them starts another.
std::shared_ptr<void> oneThread();

}  // namespace palpate::sweep
