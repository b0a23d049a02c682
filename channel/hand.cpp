#include <channel/channel.h>
#include <channel/segment.h>

#include <unistd.h>

#include <bit>
#include <utility>

namespace palpate::channel {
namespace {

InputBlock& blockAt(const Mapping& page) noexcept
{
    return *reinterpret_cast<InputBlock*>(page.base());
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
    Mapping page = session.scenery().viewersHand != 0 ? session.inputToWrite() : Mapping();
    if (!page || !hold(blockAt(page)))
        return std::nullopt;
    ViewersHand hand;
    hand.page_ = std::move(page);
    return hand;
}

ViewersHand::~ViewersHand()
{
    if (!page_)
        return;
    // A process that was forked has a copy, and the hand stays the parent's.
    std::uint64_t mine = handOf(static_cast<std::uint64_t>(::getpid()));
    blockAt(page_).holder.compare_exchange_strong(mine, 0, std::memory_order_acq_rel);
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
