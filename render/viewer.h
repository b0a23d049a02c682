#pragma once

#include <render/concealment.h>
#include <render/ghost.h>
#include <render/palette.h>
#include <render/recorded.h>
#include <render/screen_plan.h>

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace palpate::render {

/// Times at which something happened, as they come to be known. For any thread.
class Moments {
public:
    /// Not earlier than the ones before.
    void add(double time);
    /// The next after `time`, or the last before it [s]; nothing: there is none.
    std::optional<double> from(double time, bool onwards) const;

private:
    mutable std::mutex guard_;
    std::vector<double> times_;  // [s]
};

/// A record that is played: the viewer asks, whoever plays it tells how it goes.
struct Playback {
    std::atomic<bool> paused{false};
    std::atomic<double> speed{1};                                        // session time over real time
    std::atomic<double> jump{std::numeric_limits<double>::quiet_NaN()};  // to this time [s]; taken by the player
    std::atomic<double> time{0};                                         // shown now [s]
    std::atomic<double> ready{0};                                        // computed so far [s]
    std::atomic<double> length{0};                                       // [s]; negative when there is nothing to show
    Moments moments;                                                     // of what was computed so far
    Recorded recorded;                                                   // ... in it
    std::atomic<const char*> fault{nullptr};                             // what is wrong with the record, in a few words
};

/// What a viewer shows, and where.
struct ViewerOptions {
    std::string session;                   // name; empty = the only one that runs
    std::string title;                     // heading of the picture; empty = the scene's name
    std::filesystem::path offscreen;       // folder for PNG files
    std::filesystem::path movie;           // MP4 file; neither = a window
    Ghost ghost;                           // of an expert, shown beside a record; empty: none
    Palette palette = Palette::standard;   // of tissues
    bool sounds = false;                   // for warnings (windows only)
    bool leftHanded = false;               // the mouse is in the left hand: its buttons change places
    Concealment concealed;                 // what is not shown, in a test
    bool steps = true;                     // the step that one is at and what is wrong, in words (windows only)
    double tryout = 0;                     // of so many seconds: what the hand does, in words; 0: no tryout
    std::filesystem::path result;          // figures of the session, once it has ended: shown in its window
    bool watches = false;                  // only: never becomes the hand of a session
    bool hidden = false;                   // the window is on a display of its own that nobody sees, for measurements
    Layout layout = Layout::trainee;       // to begin with
    SliceLook slices = SliceLook::tinted;  // to begin with, where there is an image
    bool ultrasound = false;               // the ultrasound picture, to begin with
    std::filesystem::path images = ".";    // folder for ultrasound pictures that are stored
    int width = 1280, height = 960;        // [pixels]
    double every = 0.5;                    // offscreen: session time from one picture to the next [s]
    double from = 0;                       // offscreen and movie, of a record: the first picture [s]
    double wait = 10;                      // how long without a session before giving up [s]
    std::uint64_t frames = 0;              // end after so many pictures; 0 = no limit
    Playback* playback = nullptr;          // of the session, when it is a record
    std::filesystem::path record;          // its file; where it is removed meanwhile, no film of it is kept
};

/// A picture, by the clock CLOCK_MONOTONIC.
struct Shown {
    std::uint64_t tick = 0;     // that it shows
    double published = 0;       // when the simulation published the tick [s]
    double read = 0, done = 0;  // when the viewer had its state, and when the picture was finished [s]
};

/// What a viewer has measured of itself.
struct ViewerFigures {
    std::uint64_t frames = 0;
    double frameP50 = 0, frameP90 = 0;  // from a new state to the finished picture [s]
    double delayP50 = 0, delayP99 = 0;  // from the tick to its picture [s]
    double rate = 0;                    // frames per second while it was showing
    std::string display;                // what draws: the renderer's name
    // Of the ultrasound picture, where it was shown: processor time of a picture and of its stages [s].
    std::uint64_t scans = 0;
    double scanP50 = 0, scanP90 = 0, firstScan = 0;
    std::vector<std::pair<std::string, double>> scanStages;
    std::vector<Shown> shown;  // each picture of a tick that was not shown before
    bool filmed = false;       // there is a film, with pictures in it
    int signal = 0;            // that has ended it; 0: none
};

/// Shows a session until it has ended, its window is closed, or SIGINT or SIGTERM comes. Attaches late, attaches again when
/// the session is started again, and never makes the simulation wait. Where there is no display, `offscreen` and `movie`
/// start one of its own. Throws std::runtime_error when there is no session within `wait`, the session was killed, there is
/// no display, folder or movie cannot be written, or the record of a film is no longer there.
ViewerFigures runViewer(const ViewerOptions& options);

}  // namespace palpate::render
