#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace palpate::apps {

struct CtExport {
    std::filesystem::path output;
    std::string record;
    double at = 0;  // [s]
    std::string window;
    int side = 512;  // of a slice [pixels]
};

/// Writes a CT scan of a record's body at one moment, as a viewer would show it. Returns what to say of it. Throws
/// std::runtime_error.
std::string exportCt(const CtExport& o, const std::function<void(double)>& progress);

}  // namespace palpate::apps
