#include <base/end_in_order.h>

#include <signal.h>

#include <array>
#include <cstddef>
#include <mutex>

namespace palpate::base {

struct EndInOrder::Flags {
    std::atomic<bool> wanted{false};
    std::atomic<int> signal{0};
    bool isTaken = true;  // guarded by `endings`
    Flags* next = nullptr;

    void set(int by) noexcept
    {
        if (by != SIGUSR1) {
            signal = by;
        }
        wanted = true;
    }
    void clear() noexcept
    {
        wanted = false;
        signal = 0;
    }
};

namespace {

constexpr std::array endSignals{SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGUSR1};

EndInOrder::Flags ofProcess;
std::atomic<EndInOrder::Flags*> firstFlags{nullptr};  // of all that ever lived at once; grows at its head
static_assert(std::atomic<EndInOrder::Flags*>::is_always_lock_free && std::atomic<int>::is_always_lock_free);

std::mutex endings;  // guards what follows; no handler takes it
std::size_t living = 0;
std::array<struct sigaction, endSignals.size()> actionsBefore{};

void onSignal(int signal)
{
    ofProcess.set(signal);
    for (EndInOrder::Flags* flags = firstFlags; flags != nullptr; flags = flags->next) {
        flags->set(signal);
    }
}

// Cleared: what nobody has any more may have been set since.
EndInOrder::Flags* takeFlags()
{
    for (EndInOrder::Flags* flags = firstFlags; flags != nullptr; flags = flags->next) {
        if (!flags->isTaken) {
            flags->isTaken = true;
            flags->clear();
            return flags;
        }
    }
    auto* const made = new EndInOrder::Flags;
    made->next = firstFlags;
    firstFlags = made;
    return made;
}

}  // namespace

EndInOrder::EndInOrder()
{
    const std::scoped_lock lock(endings);
    flags_ = takeFlags();
    if (living++ > 0) {
        return;
    }
    ofProcess.clear();
    struct sigaction action {};
    action.sa_handler = onSignal;
    for (std::size_t i = 0; i < endSignals.size(); ++i) {
        ::sigaction(endSignals[i], &action, &actionsBefore[i]);
    }
}

EndInOrder::~EndInOrder()
{
    const std::scoped_lock lock(endings);
    flags_->isTaken = false;
    if (--living > 0) {
        return;
    }
    for (std::size_t i = 0; i < endSignals.size(); ++i) {
        ::sigaction(endSignals[i], &actionsBefore[i], nullptr);
    }
}

const std::atomic<bool>& EndInOrder::wanted() const noexcept
{
    return flags_->wanted;
}

void EndInOrder::end() noexcept
{
    flags_->wanted = true;
}

int EndInOrder::interruptedBy() const noexcept
{
    return flags_->signal;
}

const std::atomic<bool>& EndInOrder::asked() noexcept
{
    return ofProcess.wanted;
}

int EndInOrder::signal() noexcept
{
    return ofProcess.signal;
}

}  // namespace palpate::base
