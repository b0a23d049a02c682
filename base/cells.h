#pragma once

#include <glm/vec3.hpp>

#include <cstddef>

/// Boxes of cells as they lie in memory, x fastest.
namespace palpate::base {

inline std::size_t countOf(glm::ivec3 size) noexcept
{
    return static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y) * static_cast<std::size_t>(size.z);
}

inline std::size_t offsetOf(glm::ivec3 size, glm::ivec3 cell) noexcept
{
    return (static_cast<std::size_t>(cell.z) * static_cast<std::size_t>(size.y) + static_cast<std::size_t>(cell.y)) *
               static_cast<std::size_t>(size.x) +
           static_cast<std::size_t>(cell.x);
}

inline glm::ivec3 cellOf(glm::ivec3 size, std::size_t offset) noexcept
{
    const auto nx = static_cast<std::size_t>(size.x), ny = static_cast<std::size_t>(size.y);
    return {static_cast<int>(offset % nx), static_cast<int>(offset / nx % ny), static_cast<int>(offset / nx / ny)};
}

inline bool holds(glm::ivec3 size, glm::ivec3 cell) noexcept
{
    return cell.x >= 0 && cell.y >= 0 && cell.z >= 0 && cell.x < size.x && cell.y < size.y && cell.z < size.z;
}

}  // namespace palpate::base
