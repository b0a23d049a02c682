#pragma once

#include <haptics/falcon/transport.h>

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace palpate::falcon {

/// The image that the Falcon's processor runs. It is its maker's and does not come with this program.
struct Firmware {
    std::string file;
    std::vector<std::uint8_t> image;
};

/// Throws Trouble (firmwareFile) for a file that cannot be read or cannot be an image.
Firmware readFirmware(const std::filesystem::path& file);

/// Brings the Falcon into firmware-load mode and uploads the image; every byte has to come back as it was sent. Throws
/// Trouble: silent, garbled, unplugged, interrupted.
void loadFirmware(Transport& wire, const Firmware& firmware, const std::atomic<bool>& stop);

/// Settings under which a loaded Falcon exchanges packets; what was on its way is thrown away.
void enterRunMode(Transport& wire);

}  // namespace palpate::falcon
