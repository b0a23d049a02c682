#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace palpate::render {

/// What a viewer shows, and where.
struct ViewerOptions {
    std::string session;              // name; empty = the only one that runs
    std::filesystem::path offscreen;  // folder for PNG files; empty = a window
    int width = 1280, height = 960;   // [pixels]
    double every = 0.5;               // offscreen: session time from one picture to the next [s]
    double wait = 10;                 // how long without a session before giving up [s]
    std::uint64_t frames = 0;         // end after so many pictures; 0 = no limit
};

/// What a viewer has measured of itself.
struct ViewerFigures {
    std::uint64_t frames = 0;
    double frameP50 = 0, frameP90 = 0;  // from a new state to the finished picture [s]
    double delayP50 = 0, delayP99 = 0;  // from the tick to its picture [s]
    double rate = 0;                    // frames per second while it was showing
    std::string display;                // what draws: the renderer's name
};

/// Shows a session until it has ended, its window is closed, or SIGINT or SIGTERM comes. Attaches late, attaches again when
/// the session is started again, and never makes the simulation wait. Where there is no display, `offscreen` starts one of
/// its own. Throws std::runtime_error when there is no session within `wait`, the session was killed, there is no display,
/// or the folder cannot be written.
ViewerFigures runViewer(const ViewerOptions& options);

}  // namespace palpate::render
