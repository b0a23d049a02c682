#include <python/unlocked.h>

#include <dlfcn.h>
#include <pthread.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <thread>

namespace palpate::python {

namespace {

// Of the process, as the interpreter is.
std::atomic<bool> isEnding = false, isAbandoned = false;
std::atomic<std::thread::id> endingThread;  // has to work to the end
int unlockedThreads = 0;                    // is changed and read with the GIL held

void waitForThreads()
{
    endingThread = std::this_thread::get_id();
    isEnding = true;
    while (unlockedThreads > 0 && !isAbandoned) {
        {
            const pybind11::gil_scoped_release others;
            std::this_thread::sleep_for(std::chrono::milliseconds(2));
        }
        if (PyErr_CheckSignals() != 0) {
            isAbandoned = true;
            throw pybind11::error_already_set();
        }
    }
}

// OpenVDB brings log4cplus, which starts threads when it is loaded. Its destructor waits for them, in a forked process for
// ever. OpenVDB does not use them. Its headers are not installed, and other builds of OpenVDB are without it.
void stopLogThreads()
{
    if (void* const stop = dlsym(RTLD_DEFAULT, "_ZN9log4cplus18shutdownThreadPoolEv")) {
        reinterpret_cast<void (*)()>(stop)();
    }
}

}  // namespace

Unlocked::Unlocked()
{
    if (ending()) {
        throwEnding();
    }
    ++unlockedThreads;
    thread_ = PyEval_SaveThread();
}

Unlocked::~Unlocked()
{
    while (isAbandoned && ending()) {
        pause();  // there is nothing to come back to
    }
    PyEval_RestoreThread(thread_);
    --unlockedThreads;
}

bool ending() noexcept
{
    return isEnding && endingThread.load() != std::this_thread::get_id();
}

void throwEnding()
{
    PyErr_SetNone(PyExc_SystemExit);
    throw pybind11::error_already_set();
}

void waitAtExit()
{
    stopLogThreads();
    // A forked process has none of the other threads.
    pthread_atfork(nullptr, nullptr, [] { unlockedThreads = 0; });
    pybind11::module_::import("atexit").attr("register")(pybind11::cpp_function(&waitForThreads));
}

}  // namespace palpate::python
