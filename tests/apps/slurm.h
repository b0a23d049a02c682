#pragma once

#include <tests/folder.h>

#include <string>

namespace palpate::apps {

/// A Slurm of one node on this machine, for the programs that this process starts: munged, slurmctld and slurmd on the
/// loopback. It goes away at the end.
class Slurm {
public:
    Slurm();
    ~Slurm();
    Slurm(const Slurm&) = delete;
    Slurm& operator=(const Slurm&) = delete;

    /// Empty: it runs; else why not.
    const std::string& problem() const noexcept { return problem_; }

private:
    void start();
    bool run(const std::string& command, const std::string& what);

    tests::Folder folder_;
    std::string problem_;
};

}  // namespace palpate::apps
