#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace palpate::apps {

struct UltrasoundExport {
    std::filesystem::path output;
    std::string record;
    double at = 0;  // [s]
    std::filesystem::path
        like;  // a stored image whose probe, settings, size and moment are taken; empty: the session's own
    int width = 800, height = 600;
};

/// Writes the ultrasound picture of a record at one moment, bit for bit as a viewer stores it. Returns what to say of it.
/// Throws std::runtime_error.
std::string exportUltrasound(const UltrasoundExport& o, const std::function<void(double)>& progress);

}  // namespace palpate::apps
