#include <channel/channel.h>
#include <channel/segment.h>

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <bit>
#include <utility>

namespace palpate::channel {
namespace {

InputBlock& blockAt(void* page) noexcept
{
    return *static_cast<InputBlock*>(page);
}

// One that is dead is no holder.
bool hold(InputBlock& block) noexcept
{
    const std::uint64_t mine = handOf(static_cast<std::uint64_t>(::getpid()));
    std::uint64_t holder = block.holder.load(std::memory_order_acquire);
    return !holderLives(holder) && block.holder.compare_exchange_strong(holder, mine, std::memory_order_acq_rel);
}

}  // namespace

std::optional<ViewersHand> ViewersHand::take(const Subscriber& session)
{
    const int file = session.scenery().viewersHand != 0 ? session.openToWrite() : -1;
    if (file < 0)
        return std::nullopt;
    void* mapped = ::mmap(nullptr, sizeof(InputBlock), PROT_READ | PROT_WRITE, MAP_SHARED, file,
                          static_cast<off_t>(session.inputOffset()));
    ::close(file);
    if (mapped == MAP_FAILED)
        return std::nullopt;
    MappingGuard guard(mapped, sizeof(InputBlock));
    if (!hold(blockAt(mapped))) {
        guard = {};
        ::munmap(mapped, sizeof(InputBlock));
        return std::nullopt;
    }
    ViewersHand hand;
    hand.page_ = mapped;
    hand.guard_ = std::move(guard);
    return hand;
}

ViewersHand::ViewersHand(ViewersHand&& other) noexcept
    : page_(std::exchange(other.page_, nullptr)), guard_(std::move(other.guard_))
{
}

ViewersHand& ViewersHand::operator=(ViewersHand&& other) noexcept
{
    if (this != &other) {
        release();
        page_ = std::exchange(other.page_, nullptr);
        guard_ = std::move(other.guard_);
    }
    return *this;
}

ViewersHand::~ViewersHand()
{
    release();
}

void ViewersHand::release() noexcept
{
    if (page_ == nullptr)
        return;
    // A process that was forked has a copy, and the hand stays the parent's.
    std::uint64_t mine = handOf(static_cast<std::uint64_t>(::getpid()));
    blockAt(page_).holder.compare_exchange_strong(mine, 0, std::memory_order_acq_rel);
    guard_ = {};
    ::munmap(page_, sizeof(InputBlock));
    page_ = nullptr;
}

void ViewersHand::set(Input input) noexcept
{
    InputBlock& block = blockAt(page_);
    constexpr std::size_t beat = offsetof(Input, beat) / sizeof(std::uint64_t);
    auto words = std::bit_cast<std::array<std::uint64_t, inputWords>>(input);
    words[beat] = block.words[beat].load(std::memory_order_relaxed) + 1;
    writeLocked(block, words);
}

}  // namespace palpate::channel
