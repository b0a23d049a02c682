#include <haptics/falcon/buttons.h>

#include <algorithm>
#include <array>
#include <utility>

namespace palpate::falcon {

constexpr double betweenLooks = 5e-3;  // [s]

constexpr std::array<std::pair<std::uint8_t, std::string_view>, 4> names{
    {{buttonRight, "right"}, {buttonForward, "forward"}, {buttonCentre, "centre"}, {buttonLeft, "left"}}};

std::uint8_t Presses::take(std::uint8_t buttons, double now) noexcept
{
    if (!begun_ || buttons != seen_) {
        begun_ = true;
        seen_ = buttons;
        since_ = now;
    }
    if (now - since_ < settled) {
        return 0;
    }
    const auto pressed = static_cast<std::uint8_t>(seen_ & ~down_);
    down_ = seen_;
    return pressed;
}

std::string_view nameOf(std::uint8_t button) noexcept
{
    const auto found = std::ranges::find(names, button, [](const auto& one) { return one.first; });
    return found == names.end() ? "" : found->second;
}

void watchButtons(Link& link, Transport& wire, const std::function<void(std::uint8_t)>& pressed,
                  const std::function<bool()>& ended)
{
    Presses presses;
    while (!ended() && !link.lost()) {
        const std::uint8_t down = link.exchange({}) ? presses.take(link.reading().buttons, wire.now()) : 0;
        for (const auto& [bit, name] : names) {
            if ((down & bit) != 0) {
                pressed(bit);
            }
        }
        wire.sleep(betweenLooks);
    }
    link.rest();
}

}  // namespace palpate::falcon
