#include <render/grey_image.h>

#include <render/deformation.h>
#include <render/events.h>

#include <fmt/format.h>
#include <glm/common.hpp>

#include <algorithm>
#include <cstddef>

namespace palpate::render {

GreyImage::GreyImage(const channel::Scenery& scenery, std::span<const std::uint16_t> codes)
    : scenery_(scenery), codes_(codes.begin(), codes.end())
{
    look(0);
}

void GreyImage::look(std::uint32_t window) noexcept
{
    window_ = window;
    const channel::GreyWindow& w = scenery_.window[window];
    constexpr double narrowest = 1e-9;  // in the image's unit
    const double perUnit = 255 / std::max(w.high - w.low, narrowest);
    black_ = static_cast<float>((scenery_.imageLow - w.low) * perUnit);
    perCode_ = static_cast<float>(scenery_.imageStep * perUnit);
}

void GreyImage::nextWindow() noexcept
{
    if (!empty())
        look((window_ + 1) % scenery_.windows);
}

std::string GreyImage::windowName() const
{
    return text(scenery_.window[window_].name);
}

std::string GreyImage::windowRange() const
{
    const channel::GreyWindow& w = scenery_.window[window_];
    const std::string unit = text(scenery_.imageUnit);
    const double width = w.high - w.low;
    const int digits = width >= 100 ? 0 : width >= 1 ? 2 : 5;
    return fmt::format("{:.{}f} to {:.{}f}{}{}", w.low, digits, w.high, digits, unit.empty() ? "" : " ", unit);
}

float GreyImage::at(glm::dvec3 p) const noexcept
{
    const channel::Grid& grid = scenery_.labels;
    const glm::vec3 g((p - vec(grid.origin)) / grid.spacing);
    const glm::vec3 last(grid.size[0] - 1, grid.size[1] - 1, grid.size[2] - 1);
    if (!(g.x >= 0 && g.y >= 0 && g.z >= 0 && g.x < last.x && g.y < last.y && g.z < last.z))
        return 0;
    const glm::ivec3 cell(g);
    const glm::vec3 part = g - glm::vec3(cell);
    const auto row = static_cast<std::size_t>(grid.size[0]), layer = row * static_cast<std::size_t>(grid.size[1]);
    const std::uint16_t* code = &codes_[static_cast<std::size_t>(cell.z) * layer + static_cast<std::size_t>(cell.y) * row +
                                        static_cast<std::size_t>(cell.x)];
    const auto alongX = [&](std::size_t at) {
        const float from = code[at], to = code[at + 1];
        return from + part.x * (to - from);
    };
    const auto alongXY = [&](std::size_t at) { return glm::mix(alongX(at), alongX(at + row), part.y); };
    return std::clamp(black_ + perCode_ * glm::mix(alongXY(0), alongXY(layer), part.z), 0.0F, 255.0F);
}

}  // namespace palpate::render
