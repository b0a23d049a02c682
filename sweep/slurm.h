#pragma once

#include <sweep/folder.h>

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace palpate::sweep {

/// Told now and then while jobs run; false: cancel them.
using SlurmTold = std::function<bool(std::size_t done, std::size_t running, std::size_t waiting)>;

/// Runs the cases as tasks of a Slurm job array: submits, watches, submits again what was lost (killed, timed out, a node
/// that failed), until each has its row or was lost three times, which is its row then. Returns whether it came to its end.
/// Throws std::runtime_error where there is no Slurm or it refuses the job.
bool runOnSlurm(SweepFolder& folder, const std::vector<std::size_t>& cases, const SlurmSettings& settings,
                const std::string& build, const SlurmTold& told);

/// What a task of the array does: the cases of its chunk that have no row yet. `file`: of the submission.
void workOnChunk(const std::filesystem::path& file, int jobs, const std::string& build);

}  // namespace palpate::sweep
