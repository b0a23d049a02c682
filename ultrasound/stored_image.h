#pragma once

#include <ultrasound/display.h>

#include <filesystem>
#include <string>

namespace palpate::ultrasound {

/// The picture of a BeamImage as a file: 8-bit grey PNG with scale and marks, and in its text "palpate" tick, pose, probe,
/// settings and body as JSON.
std::string storedImage(const BeamImage& image, int width, int height);

/// What a stored image says of how it was made; `grey` is empty.
struct StoredHow {
    BeamImage image;
    int width = 0, height = 0;
};

/// Reads back what storedImage() wrote. Throws std::runtime_error ("FILE: what is wrong and what to do").
StoredHow readStored(const std::filesystem::path& file);

}  // namespace palpate::ultrasound
