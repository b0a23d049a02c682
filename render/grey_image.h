#pragma once

#include <channel/layout.h>

#include <glm/vec3.hpp>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace palpate::render {

/// The intensity image of a body at rest, through one of the session's windows.
class GreyImage {
public:
    /// `codes`: as channel::Subscriber::image(); copied. Empty where there is no image.
    GreyImage(const channel::Scenery& scenery, std::span<const std::uint16_t> codes);

    bool empty() const noexcept { return codes_.empty(); }
    /// Looks through the next window; after the last comes the first.
    void nextWindow() noexcept;
    std::uint32_t window() const noexcept { return window_; }
    /// "soft tissue", and "-160 to 240 HU".
    std::string windowName() const;
    std::string windowRange() const;
    /// From 0, black, to 255, at the rest point `p` [m]: trilinear; black outside the grid. Not to be asked without an
    /// image.
    float at(glm::dvec3 p) const noexcept;

private:
    void look(std::uint32_t window) noexcept;

    channel::Scenery scenery_;
    std::vector<std::uint16_t> codes_;
    std::uint32_t window_ = 0;
    float black_ = 0, perCode_ = 0;  // grey of code 0, and of each further code
};

}  // namespace palpate::render
