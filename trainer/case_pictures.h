#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace palpate::trainer {

struct Pixels {
    int width = 0, height = 0;
    std::vector<std::uint8_t> rgb;  // height x width x 3, from the upper left; empty: there is no such picture
};

/// A PNG file of 64 MiB at most.
Pixels casePicture(const std::string& picture);

}  // namespace palpate::trainer
