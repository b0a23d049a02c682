#include <apps/no_thread.h>

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <exception>
#include <system_error>

namespace {

std::terminate_handler usual = nullptr;

// A thread that could not be started, where nobody can catch that.
void endWithoutThread()
{
    try {
        if (const std::exception_ptr what = std::current_exception()) {
            std::rethrow_exception(what);
        }
    } catch (const std::system_error& e) {
        if (const char* const what = palpate::apps::noThread(e)) {
            std::fprintf(stderr, "%s: %s\n", program_invocation_short_name, what);
            ::_exit(1);
        }
    } catch (...) {
    }
    usual();
}

void beforeMain(int /*count*/, char** /*words*/, char** /*environment*/)
{
    usual = std::set_terminate(endWithoutThread);
}

// Libraries start threads before main(): OpenVDB's log4cplus has four. Only what is in this section runs before those.
[[gnu::section(".preinit_array"), gnu::used]] void (*const runBeforeMain)(int, char**, char**) = beforeMain;

}  // namespace
