#include <command/progress.h>

#include <fmt/format.h>

#include <unistd.h>

#include <algorithm>

namespace palpate::command {

using namespace std::chrono_literals;

Progress::Progress(Clock clock) : terminal_(isatty(STDERR_FILENO) != 0)
{
    if (terminal_ && clock == Clock::ticking) {
        clock_ = std::jthread([this](std::stop_token stop) { tick(stop); });
    }
}

Progress::~Progress()
{
    clock_ = {};
    clear();
}

void Progress::show(const std::string& what)
{
    if (!terminal_) {
        return;
    }
    const std::lock_guard lock(mutex_);
    const bool news = what != what_;
    what_ = what;
    if (news && (!clock_.joinable() || Time::now() - drawn_ > 50ms)) {
        draw();
    }
}

void Progress::show(const std::string& what, double fraction)
{
    constexpr int width = 30;  // characters
    const int done = std::clamp(static_cast<int>(fraction * width), 0, width);
    show(fmt::format("{} [{:#<{}}{:.<{}}] {:.0f} %", what, "", done, "", width - done, 100 * fraction));
}

void Progress::clear()
{
    const std::lock_guard lock(mutex_);
    what_.clear();
    if (shown_) {
        fmt::print(stderr, "\r\x1b[K");
        std::fflush(stderr);
        shown_ = false;
    }
}

void Progress::draw()
{
    const auto since = Time::now() - start_;
    if (what_.empty() || since < 1s) {
        return;
    }
    drawn_ = Time::now();
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(since).count();
    fmt::print(stderr, "\r\x1b[K{} s: {}", seconds, what_);
    std::fflush(stderr);
    shown_ = true;
}

void Progress::tick(std::stop_token stop)
{
    std::unique_lock lock(mutex_);
    while (!stop.stop_requested()) {
        wake_.wait_for(lock, stop, 250ms, [] { return false; });
        draw();
    }
}

}  // namespace palpate::command
