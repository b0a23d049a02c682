#pragma once

#include <algorithm>

namespace palpate::base {

inline constexpr int leastSide = 320;  // of windows and their pictures [pixels]
inline constexpr int mostSide = 8192;  // of any picture

struct WindowSize {
    int width = 0, height = 0;  // [pixels]
};

/// Of a window that is to be so large and has to be seen whole.
/// @param screen  what is free of it; 0: not known
/// @param wanted  where the screen has room
constexpr WindowSize fittedTo(WindowSize screen, WindowSize wanted) noexcept
{
    const auto side = [](int most, int of) { return most > 0 ? std::min(most, of) : of; };
    return {side(screen.width, wanted.width), side(screen.height, wanted.height)};
}

}  // namespace palpate::base
