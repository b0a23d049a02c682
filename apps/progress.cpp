#include <apps/progress.h>

#include <fmt/format.h>

#include <unistd.h>

namespace palpate::apps {

Progress::Progress() : terminal_(isatty(STDERR_FILENO) != 0) {}

void Progress::show(const std::string& what)
{
    using namespace std::chrono_literals;
    const auto since = std::chrono::steady_clock::now() - start_;
    if (!terminal_ || since < 2s) {
        return;
    }
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(since).count();
    fmt::print(stderr, "\r\x1b[K{} s: {}", seconds, what);
    std::fflush(stderr);
    shown_ = true;
}

void Progress::clear()
{
    if (shown_) {
        fmt::print(stderr, "\r\x1b[K");
        std::fflush(stderr);
        shown_ = false;
    }
}

}  // namespace palpate::apps
