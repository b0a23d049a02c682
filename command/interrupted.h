#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

namespace palpate::command {

/// From now on Ctrl-C, a polite kill and a terminal that is closed (SIGINT, SIGTERM, SIGHUP, SIGQUIT) end this program,
/// `name`, with one line that says so and the exit status 128 + signal. For commands that have nothing to end in order;
/// others install handlers of their own meanwhile. A signal that is ignored stays ignored (nohup).
void endOnSignals(std::string_view name);

/// From now on a file that grows over the user's limit (ulimit -f) is an error of its writer, as a full disk is; the system
/// would end the program without a word.
void failOnLargeFiles();

/// What was asked for has been ended in order by a signal, before its time: the program's exit status is 128 + signal.
class Interrupted : public std::runtime_error {
public:
    Interrupted(int signal, const std::string& what) : std::runtime_error(what), signal_(signal) {}
    int exitStatus() const noexcept { return 128 + signal_; }

private:
    int signal_;
};

}  // namespace palpate::command
