#pragma once

#include <studies/stability/matrix.h>

#include <cstdint>

namespace palpate::studies {

/// What hostile sessions of our method came to.
struct FuzzResult {
    std::uint64_t runs = 0;
    std::uint64_t ticks = 0;
    std::uint64_t crashes = 0;          // sessions that ended by an exception
    std::uint64_t overCap = 0;          // ticks with a force over the cap
    std::uint64_t overSlew = 0;         // ticks in which the force changed faster than it may
    std::uint64_t nonFinite = 0;        // ticks with a force that is no number
    std::uint64_t pulled = 0;           // ticks in which tissue pulls a blunt tool into the body: see PullWatch in fuzz.cpp
    std::vector<std::uint64_t> failed;  // seeds of sessions with any of them, the first ten
};

/// `runs` sessions of 0.2 to 0.5 s, of seeds `seed`, `seed` + 1, ..: a random scene, level, device and rate; poses wander,
/// press to four radii and draw back, jump, shake, are no numbers, stop and leave gaps; the dead-man switch and the gun's
/// button flicker; the machine is too slow. In half of the sessions poses are whole steps of the encoder; in a third the
/// body is absurd but legal: rock, water, tools larger than it. The result depends on the seed alone.
FuzzResult fuzz(StabilityModels& models, std::uint64_t seed, std::uint64_t runs, int jobs,
                const std::function<void(std::size_t)>& told);

}  // namespace palpate::studies
