#include <chainmail/violation_queue.h>

#include <algorithm>
#include <bit>
#include <cassert>

namespace palpate::chainmail {

ViolationQueue::ViolationQueue(double spacing, std::size_t capacity)
    : levelsPerMetre_(levelsPerSpacing / static_cast<float>(spacing)),
      slots_(capacity),
      first_(levels, none),
      last_(levels, none),
      filled_(levels / 64, 0)
{
    clear();
}

void ViolationQueue::clear() noexcept
{
    while (!empty()) {
        pop();
    }
    for (std::uint32_t i = 0; i < slots_.size(); ++i) {
        slots_[i].next = i + 1 < slots_.size() ? i + 1 : none;
    }
    free_ = 0;
}

std::uint32_t ViolationQueue::level(float violation) const noexcept
{
    return static_cast<std::uint32_t>(std::min(violation * levelsPerMetre_, static_cast<float>(levels - 1)));
}

std::uint32_t ViolationQueue::top() const noexcept
{
    const auto word = 63U - static_cast<std::uint32_t>(std::countl_zero(summary_));
    return 64U * word + 63U - static_cast<std::uint32_t>(std::countl_zero(filled_[word]));
}

void ViolationQueue::push(Pull pull, float violation) noexcept
{
    assert(free_ != none);
    const std::uint32_t slot = free_;
    free_ = slots_[slot].next;
    slots_[slot] = {pull, none};

    const std::uint32_t at = level(violation);
    if (first_[at] == none) {
        first_[at] = slot;
        filled_[at / 64] |= std::uint64_t{1} << at % 64;
        summary_ |= std::uint64_t{1} << at / 64;
    } else {
        slots_[last_[at]].next = slot;
    }
    last_[at] = slot;
}

Pull ViolationQueue::pop() noexcept
{
    const std::uint32_t at = top();
    const std::uint32_t slot = first_[at];
    first_[at] = slots_[slot].next;
    if (first_[at] == none) {
        filled_[at / 64] &= ~(std::uint64_t{1} << at % 64);
        if (filled_[at / 64] == 0) {
            summary_ &= ~(std::uint64_t{1} << at / 64);
        }
    }
    slots_[slot].next = free_;
    free_ = slot;
    return slots_[slot].pull;
}

}  // namespace palpate::chainmail
