#pragma once

#include <pybind11/pybind11.h>

namespace palpate::python {

/// While it lives, other threads of Python go on, as with pybind11::gil_scoped_release. The interpreter waits for it before
/// it ends: a thread that comes back to an interpreter that has ended would abort the process.
/// Constructed in another thread than that which ends the interpreter already, it throws SystemExit, which ends the thread
/// without a word.
class Unlocked {
public:
    Unlocked();
    ~Unlocked();
    Unlocked& operator=(Unlocked&&) = delete;

private:
    PyThreadState* thread_;
};

/// Whether another thread ends the interpreter: what runs here should stop. Needs no GIL.
bool ending() noexcept;

/// Throws SystemExit.
[[noreturn]] void throwEnding();

/// Has the interpreter wait for all Unlocked of other threads when it ends, until Ctrl-C; and a forked process ends
/// although it has none of the threads of libraries.
void waitAtExit();

}  // namespace palpate::python
