#include <render/viewer.h>

#include <base/error.h>
#include <base/window_size.h>
#include <render/display.h>
#include <render/hosts.h>

#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <iterator>
#include <thread>

namespace palpate::render {
namespace {

// A signal handler can reach nothing else.
std::atomic<int> interruptedBy{0};  // a signal; 0: none
static_assert(std::atomic<int>::is_always_lock_free);

void onInterrupt(int signal)
{
    interruptedBy = signal;
}

// The simulation comes first: a viewer that draws in software would take every core there is.
void standBack()
{
    constexpr int nicer = 5;
    [[maybe_unused]] const int level = ::nice(nicer);
    const unsigned cores = std::thread::hardware_concurrency();
    ::setenv("LP_NUM_THREADS", std::to_string(cores > 4 ? cores / 2 : std::min(cores, 2U)).c_str(), 0);
    // Buffers of every picture would else go back to the system and come again: the kernel clears them, and while it does
    // the simulation cannot have that core.
    constexpr int kept = 32 << 20;  // [bytes]
    ::mallopt(M_MMAP_THRESHOLD, kept);
    ::mallopt(M_TRIM_THRESHOLD, kept);
}

void check(const ViewerOptions& options)
{
    const auto [least, most] = std::minmax(options.width, options.height);
    base::failIf(least < base::leastSide || most > base::mostSide, "size {}x{}: each side must be {} to {} pixels",
                 options.width, options.height, base::leastSide, base::mostSide);
    base::failIf(!(options.every >= 0) || !(options.wait >= 0),
                 "the times for pictures and for waiting must be 0 s or more");
}

}  // namespace

void Moments::add(double time)
{
    const std::lock_guard lock(guard_);
    times_.push_back(time);
}

std::optional<double> Moments::from(double time, bool onwards) const
{
    constexpr double here = 5e-3;  // [s]: the one that is shown is neither before nor after
    const std::lock_guard lock(guard_);
    if (onwards) {
        const auto next = std::upper_bound(times_.begin(), times_.end(), time + here);
        return next != times_.end() ? std::optional(*next) : std::nullopt;
    }
    const auto first = std::lower_bound(times_.begin(), times_.end(), time - here);
    return first != times_.begin() ? std::optional(*std::prev(first)) : std::nullopt;
}

ViewerFigures runViewer(const ViewerOptions& options)
{
    check(options);
    interruptedBy = 0;
    for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT}) {
        if (std::signal(signal, onInterrupt) == SIG_IGN)
            std::signal(signal, SIG_IGN);
    }
    standBack();
    const bool window = options.offscreen.empty() && options.movie.empty();
    const bool works = !options.hidden && displayWorks();
    base::failIf(window && !options.hidden && !works, "{}, or use --offscreen DIR", noDisplay());
    std::optional<PrivateDisplay> display;
    if (!works)
        display.emplace();
    ViewerFigures figures = window ? showInWindow(options, interruptedBy) : writePictures(options, interruptedBy);
    figures.signal = interruptedBy;
    return figures;
}

}  // namespace palpate::render
