#pragma once

#include <stdexcept>
#include <string>

namespace palpate::command {

/// What was asked for has been ended in order by a signal, before its time: the program's exit status is 128 + signal.
class Interrupted : public std::runtime_error {
public:
    Interrupted(int signal, const std::string& what) : std::runtime_error(what), signal_(signal) {}
    int exitStatus() const noexcept { return 128 + signal_; }

private:
    int signal_;
};

}  // namespace palpate::command
