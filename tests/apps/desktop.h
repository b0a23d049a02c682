#pragma once

#include <channel/channel.h>
#include <tests/apps/program.h>
#include <tests/installed.h>

#include <glm/vec3.hpp>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace palpate::apps {

using tests::installed;

/// A display without a screen (Xvfb), with mouse and keyboard that xdotool moves.
class Desktop {
public:
    Desktop();

    /// `name`: palpate or palpate-view, on this display.
    std::unique_ptr<Program> start(const std::string& name, const std::vector<std::string>& arguments) const;
    /// xdotool's own words, such as {"key", "space"}. Returns what it printed.
    std::string xdotool(const std::vector<std::string>& words) const;
    /// Asks a window to close, as its button does.
    void close(const std::string& window) const;
    /// Waits for a window of that name, `seconds` at the most; empty when none comes.
    std::string window(const std::string& name, double seconds = 20) const;

private:
    Folder folder_;  // of what the server tells
    std::string display_;
    std::unique_ptr<Program> server_;
};

/// Lets time pass [s].
void wait(double seconds);

glm::dvec3 vec(const channel::Triple& t);

}  // namespace palpate::apps
