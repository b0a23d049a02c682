#pragma once

#include <sweep/case.h>
#include <sweep/lock.h>
#include <sweep/plan.h>

#include <nlohmann/json_fwd.hpp>

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace palpate::sweep {

/// A finished case as its file in the folder holds it.
struct SweepRow {
    std::size_t index = 0;
    std::string error;  // empty: it was done
    std::vector<double> outputs;
    std::string build, machine;
    double tickTime = 0, seconds = 0;  // timings: processor time of a tick; processor time of the case [s]

    bool failed() const noexcept { return !error.empty(); }
};

/// The folder of a sweep.
///
///     plan.toml           the plan as given
///     scene.toml          its base scene, with absolute paths
///     sweep.json          its name, and hashes of plan, scene and the files that the scene reads
///     lock                who works on it
///     cases/000/17.json   a finished case, by thousands
///     records/17.db       of plans with records
///     slurm/              job scripts, chunks and logs
///     table.csv, table.db, report.html
class SweepFolder {
public:
    /// Makes the folder for a plan, or goes on with that which holds it. `given`: a plan file or the name of a ready plan;
    /// empty: that of the folder. `hold`: nobody else may work on it while this object lives. Throws std::runtime_error,
    /// also when the folder holds another plan, its inputs have changed, or another run holds it.
    SweepFolder(std::filesystem::path folder, const std::string& given, bool hold);
    /// What is computed in a folder: for this no scene is tried, and the files that it reads may have changed or be gone.
    /// Throws std::runtime_error, also where plan or scene in the folder are not those of its cases.
    static SweepFolder ofResults(const std::filesystem::path& folder);

    const SweepPlan& plan() const noexcept { return plan_; }
    const std::filesystem::path& path() const noexcept { return folder_; }
    /// The rows there are, by case. A file that is no whole row counts as none.
    /// @param damaged  gets a line with file and key for each case file that is not what was written; such a case has no
    /// row
    std::vector<std::optional<SweepRow>> rows(std::vector<std::string>* damaged = nullptr) const;
    bool has(std::size_t index) const;
    /// Writes a row whole or not at all. Throws std::runtime_error.
    void write(const SweepRow& row) const;
    void forget(std::size_t index) const;
    /// Takes away what runs that were killed have left half written. Of a folder that is held.
    void clean() const;
    /// Of a folder that is held.
    const FolderLock& lock() const { return *lock_; }
    /// In a process of the run, see FolderLock::leave().
    void leaveLock() noexcept
    {
        if (lock_) {
            lock_->leave();
        }
    }
    /// Where a case's record goes: nothing is there yet.
    std::filesystem::path record(std::size_t index) const;

private:
    explicit SweepFolder(std::filesystem::path folder);
    std::filesystem::path caseFile(std::size_t index) const;
    void begin();
    // That plan and scene are those that the cases are of; takes in the sweep's name. Gives what sweep.json says.
    nlohmann::json checkFiles();
    // That what the scene reads is as it was.
    void checkInputs(const nlohmann::json& about) const;

    std::filesystem::path folder_;
    SweepPlan plan_;
    std::optional<FolderLock> lock_;
};

/// The text of a plan file or a ready plan, and where it comes from. Throws std::runtime_error.
std::pair<std::string, std::filesystem::path> planText(const std::string& given);

/// Runs a case and gives its row, also of one that fails.
SweepRow runCase(CaseRunner& runner, const SweepFolder& folder, std::size_t index, const std::string& build);

}  // namespace palpate::sweep
