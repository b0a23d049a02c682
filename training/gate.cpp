#include <training/gate.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::training {

bool Level::met(double value) const noexcept
{
    return !std::isnan(value) && (!atLeast || value >= *atLeast) && (!atMost || value <= *atMost);
}

double valueIn(const Values& values, std::string_view key) noexcept
{
    const auto at = values.find(key);
    return at == values.end() ? std::numeric_limits<double>::quiet_NaN() : at->second;
}

bool meets(const Gate& gate, const Values& values) noexcept
{
    return std::ranges::all_of(gate.levels, [&](const Level& level) { return level.met(valueIn(values, level.measure)); });
}

GateState stateOf(const Gate& gate, std::span<const Trial> trials)
{
    GateState state;
    std::vector<bool> met;
    for (std::size_t i = 0; i < trials.size(); ++i) {
        if (gate.testOnly && !trials[i].test) {
            continue;
        }
        met.push_back(meets(gate, trials[i].values));
        const auto window = std::min<std::size_t>(met.size(), static_cast<std::size_t>(gate.of));
        state.recentTried = static_cast<int>(window);
        state.recentMet = static_cast<int>(std::count(met.end() - static_cast<std::ptrdiff_t>(window), met.end(), true));
        if (!state.open && state.recentMet >= gate.pass) {
            state.open = true;
            state.openedAt = static_cast<int>(i);
        }
    }
    state.counted = static_cast<int>(met.size());
    return state;
}

}  // namespace palpate::training
