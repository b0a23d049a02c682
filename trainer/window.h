#pragma once

#include <trainer/results.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace palpate::trainer {

struct WindowOptions {
    std::filesystem::path programs;  // folder of palpate and palpate-view
    int width = 1280, height = 720;  // [pixels]; less on a screen that is smaller
    double textScale = 0;            // 0.5 to 3; 0: that of the settings
    std::string caseId;              // that is chosen at first; empty: the first
    std::uint64_t frames = 0;        // end after so many pictures, drawn one after the other; 0: no limit
};

/// How long the pictures of a screen take: processor and driver, from the input to the finished picture.
struct ScreenFigures {
    std::string screen;
    std::uint64_t frames = 0;
    double frameP50 = 0, frameP90 = 0, frameMax = 0;  // [s]
};

struct WindowFigures {
    std::string display;  // what draws
    ScreenFigures all;
    std::vector<ScreenFigures> screens;  // of measureScreens()
};

/// Shows the trainer until its window is closed. Throws std::runtime_error where there is no display with OpenGL 3.2.
WindowFigures runWindow(const WindowOptions& options, ResultSink& sink);

/// Draws each screen `options.frames` times, with the cases that there are and made-up people and sessions on it, and says
/// how long that takes. Throws as runWindow() does.
WindowFigures measureScreens(const WindowOptions& options, ResultSink& sink);

}  // namespace palpate::trainer
