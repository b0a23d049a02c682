#pragma once

#include <volume/geometry.h>

#include <cstddef>
#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

namespace palpate::studies {

/// Where a tool is: the centre of a sphere, the middle of a capsule's front end, or a needle's tip.
struct ToolPose {
    Vec3 position{0.0};  // patient frame [m]
    Vec3 axis{0, 1, 0};  // unit vector along the tool, towards its tip
    double seconds = 0;  // [s]
};

/// The way of a tool. Between two poses it goes straight and evenly, and its axis turns with it.
struct PosePath {
    std::string origin;           // the file, for errors
    std::vector<ToolPose> poses;  // at least one; their times rise

    /// How many ticks of 1 ms it takes: the first at the first pose, the last not before the last pose.
    std::size_t ticks() const noexcept;
    /// The pose of a tick; after the last pose the tool stays there.
    ToolPose at(std::size_t tick) const noexcept;
};

/// Reads a path: CSV with a line of column names, in any order: x_mm, y_mm, z_mm; seconds (without it: one pose per
/// millisecond); axis_x, axis_y, axis_z (of any length but zero; without them: `axis`). Lines that are empty or begin with
/// # do not count.
/// @param axis  unit vector; nothing: the file must have one
/// Throws std::runtime_error ("FILE:LINE: what is wrong and what to do"), also for numbers that are not finite, positions
/// over 10 m from the origin, times that do not rise, and over 10 million ticks.
PosePath loadPosePath(const std::filesystem::path& file, std::optional<Vec3> axis);
/// As loadPosePath() from text; `origin` stands for the file in errors.
PosePath readPosePath(std::istream& in, const std::string& origin, std::optional<Vec3> axis);

/// A point in a file.
struct FilePoint {
    Vec3 at{0.0};       // patient frame [m]
    std::string where;  // "FILE:LINE"
};

/// Reads points: CSV with the columns x_mm, y_mm, z_mm. Throws as loadPosePath().
std::vector<FilePoint> loadPoints(const std::filesystem::path& file);

}  // namespace palpate::studies
