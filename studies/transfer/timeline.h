#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace palpate::studies {

/// A picture of a viewer, by the clock CLOCK_MONOTONIC; see render::Shown.
struct TimelinePicture {
    std::uint64_t tick = 0;
    double published = 0, read = 0, done = 0;  // [s]
};

/// What `palpate-view --timeline FILE` wrote. Throws std::runtime_error for fewer than two pictures.
std::vector<TimelinePicture> readTimeline(const std::filesystem::path& file);

}  // namespace palpate::studies
