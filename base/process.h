#pragma once

#include <sys/types.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace palpate::base {

/// What this machine is called in its network.
std::string hostName();

/// Start time of process `pid` [clock ticks since boot]: a recycled number has another. 0 when it is not there or dead and
/// only not yet reaped.
std::uint64_t processStart(std::uint64_t pid) noexcept;

/// A program to be started.
struct Program {
    std::vector<std::string> words;          // a path, or a name to be looked for in PATH; then its arguments
    std::array<int, 3> streams{-1, -1, -1};  // that become its standard input, output and error; -1: this program's
    bool ownGroup = false;                   // Ctrl-C in the terminal does not reach it
};

struct StartedProgram {
    pid_t pid = -1;
    int error = 0;  // errno when it could not be started; else 0
};
/// @pre  at least one word
StartedProgram start(const Program& program);

/// Waits for the end of a child. Returns its exit status; -1 when it was killed.
int exitStatus(pid_t child) noexcept;

/// Runs a program to its end. Returns its exit status; -1 when it was killed.
/// @pre     at least one word
/// @throws  std::runtime_error when it cannot be started
int run(const Program& program);

/// For a process that does one thing for its parent, behind a fork or as a program started for it: it does not outlive its
/// parent, leaves no core behind, and what it or a library prints goes nowhere. What is wrong is told in another way.
void becomeQuietChild() noexcept;

}  // namespace palpate::base
