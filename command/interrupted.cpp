#include <command/interrupted.h>

#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdio>
#include <cstring>

namespace palpate::command {

namespace {

pid_t program = 0;
std::array<char, 64> lastWords{};  // made before there is a signal

// Only what a handler of signals may call. A forked child, which Ctrl-C reaches as well, ends without a word.
void onSignal(int signal)
{
    if (::getpid() == program) {
        constexpr std::string_view startOfLine = "\r\033[K";
        if (::isatty(STDERR_FILENO) != 0) {
            [[maybe_unused]] const auto cleared = ::write(STDERR_FILENO, startOfLine.data(), startOfLine.size());
        }
        [[maybe_unused]] const auto written = ::write(STDERR_FILENO, lastWords.data(), std::strlen(lastWords.data()));
    }
    ::_exit(128 + signal);
}

}  // namespace

void endOnSignals(std::string_view name)
{
    program = ::getpid();
    std::snprintf(lastWords.data(), lastWords.size(), "%.*s: interrupted\n", static_cast<int>(name.size()), name.data());
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
