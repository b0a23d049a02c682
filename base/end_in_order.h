#pragma once

#include <atomic>

namespace palpate::base {

/// As long as one of them lives, Ctrl-C, a polite kill and a terminal that is closed (SIGINT, SIGTERM, SIGHUP, SIGQUIT)
/// only set flags, for work that has to be ended in order; after the last they do what they did before the first. So does
/// SIGUSR1, which interrupts nothing: it is how another program says that the work is done. Several may live at once, in
/// any threads: a signal asks all of them to end, end() only its own.
class EndInOrder {
public:
    EndInOrder();
    ~EndInOrder();
    EndInOrder& operator=(EndInOrder&&) = delete;

    /// Set once the end of this work is asked for, by a signal or by end(). Valid as long as this lives.
    const std::atomic<bool>& wanted() const noexcept;
    /// Asks for the end of this work alone. From any thread.
    void end() noexcept;
    /// The signal that has interrupted this work; 0: none.
    int interruptedBy() const noexcept;

    /// Whether a signal has asked for the end since the first of those that live now, or lived last, was made: for a
    /// program that has one.
    static const std::atomic<bool>& asked() noexcept;
    /// The signal that has interrupted it; 0: none.
    static int signal() noexcept;

    /// What a signal sets; none is ever freed, so that a handler in another thread may always write to it.
    struct Flags;

private:
    Flags* flags_;
};

}  // namespace palpate::base
