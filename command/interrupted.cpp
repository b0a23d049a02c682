#include <command/interrupted.h>

#include <unistd.h>

#include <array>
#include <csignal>
#include <cstring>

namespace palpate::command {

namespace {

pid_t program = 0;

// Only what a handler of signals may call. A forked child, which Ctrl-C reaches as well, ends without a word.
void onSignal(int signal)
{
    if (::getpid() == program) {
        constexpr const char* line = "\r\033[Kpalpate: interrupted\n";
        const char* text = ::isatty(STDERR_FILENO) != 0 ? line : std::strchr(line, 'p');
        [[maybe_unused]] const auto written = ::write(STDERR_FILENO, text, std::strlen(text));
    }
    ::_exit(128 + signal);
}

}  // namespace

void endOnSignals()
{
    program = ::getpid();
    struct sigaction action {};
    action.sa_handler = onSignal;
    for (const int signal : std::array{SIGINT, SIGTERM, SIGHUP, SIGQUIT}) {
        struct sigaction before {};
        ::sigaction(signal, nullptr, &before);
        if (before.sa_handler != SIG_IGN) {
            ::sigaction(signal, &action, nullptr);
        }
    }
}

void failOnLargeFiles()
{
    std::signal(SIGXFSZ, SIG_IGN);
}

}  // namespace palpate::command
