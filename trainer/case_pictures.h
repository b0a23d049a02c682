#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::trainer {

struct Pixels {
    int width = 0, height = 0;
    std::vector<std::uint8_t> rgb;  // height x width x 3, from the upper left; empty: there is no such picture
};

/// A picture that comes with the program, by name, or a PNG file.
Pixels casePicture(const std::string& picture);

/// The bytes of pictures/NAME.
std::string_view embeddedPicture(std::string_view name) noexcept;

}  // namespace palpate::trainer
