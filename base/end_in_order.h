#pragma once

#include <signal.h>

#include <array>
#include <atomic>

namespace palpate::base {

/// As long as it lives, Ctrl-C, a polite kill and a terminal that is closed (SIGINT, SIGTERM, SIGHUP, SIGQUIT) only set a
/// flag, for work that has to be ended in order; afterwards they do what they did before. So does SIGUSR1, which interrupts
/// nothing: it is how another program says that the work is done. One at a time.
class EndInOrder {
public:
    EndInOrder();
    ~EndInOrder();
    EndInOrder& operator=(EndInOrder&&) = delete;

    /// Whether the end was asked for. The program may ask for it, too.
    static std::atomic<bool>& asked() noexcept;
    /// The signal that has interrupted the work; 0: none.
    static int signal() noexcept;

private:
    static constexpr std::array signals{SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGUSR1};
    std::array<struct sigaction, signals.size()> before_{};
};

}  // namespace palpate::base
