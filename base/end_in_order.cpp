#include <base/end_in_order.h>

namespace palpate::base {

namespace {

std::atomic<bool> endAsked{false};
std::atomic<int> signalled{0};

void onSignal(int signal)
{
    if (signal != SIGUSR1) {
        signalled = signal;
    }
    endAsked = true;
}

}  // namespace

EndInOrder::EndInOrder()
{
    endAsked = false;
    signalled = 0;
    struct sigaction action {};
    action.sa_handler = onSignal;
    for (std::size_t i = 0; i < signals.size(); ++i) {
        ::sigaction(signals[i], &action, &before_[i]);
    }
}

EndInOrder::~EndInOrder()
{
    for (std::size_t i = 0; i < signals.size(); ++i) {
        ::sigaction(signals[i], &before_[i], nullptr);
    }
}

std::atomic<bool>& EndInOrder::asked() noexcept
{
    return endAsked;
}

int EndInOrder::signal() noexcept
{
    return signalled;
}

}  // namespace palpate::base
