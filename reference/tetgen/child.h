#pragma once

#include <filesystem>

namespace palpate::reference {

/// Runs TetGen on the job in a file (tetgen_job.h), and writes what came of it. For a process of its own: TetGen may end it
/// by a signal. Returns its exit status: 0, or 1 with the reason in the result. This is all that is linked with TetGen
/// (AGPL, version 3 or later).
int runTetGenJob(const std::filesystem::path& job, const std::filesystem::path& result);

}  // namespace palpate::reference
