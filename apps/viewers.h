#pragma once

#include <base/child_process.h>
#include <haptics/session_model.h>

#include <chrono>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace palpate::apps {

/// Which viewers a session starts.
struct ViewersWanted {
    std::string session;               // its name
    std::string title;                 // of the case; empty: none
    std::string layout;                // of the window
    std::string pictures;              // folder of pictures to write; empty: none
    std::filesystem::path images;      // folder of the ultrasound pictures that its user stores; empty: the current one
    std::filesystem::path result;      // figures that will be there at the end, for the window; empty: none
    std::vector<std::string> hidden;   // tissues that the window does not show
    bool test = false;                 // no hints in the window
    std::string palette = "standard";  // of tissues
    bool sounds = false;               // for warnings
    bool leftHanded = false;           // the mouse is in the left hand
    double tryout = 0;                 // of so many seconds, see ViewerOptions; 0: none
    bool window = false;
    bool handIsHere = false;  // the window is the hand
};

/// The viewers that a session starts, each in a process of its own.
class Viewers {
public:
    /// Throws std::runtime_error where one cannot be started.
    explicit Viewers(ViewersWanted wanted);

    /// Opens a window that has crashed again, twice a second at most. False when the window that was the hand has been
    /// closed: nobody could move the tool any more.
    bool lookAfter();
    /// Until the window is closed; it closes itself when nobody has looked at the result for long.
    void waitForWindow();
    /// Stops them or lets them go on; also from another thread.
    void stall(bool stopped);

    std::optional<base::ChildProcess> window, camera;

private:
    void openWindow();
    void start(std::optional<base::ChildProcess>& viewer, std::vector<std::string> arguments) const;

    ViewersWanted wanted_;
    std::mutex guard_;
    std::chrono::steady_clock::time_point opened_;
};

/// Names of the tissues that a palpation is about, and so are not shown; none of a biopsy.
std::vector<std::string> tissuesToFind(const haptics::SessionModel& model);

/// Throws std::runtime_error where there is no viewer that could draw.
void checkViewer();

/// Draws the pictures of a session of its record: without a clock, or on a busy machine, no viewer keeps step with one.
/// Throws std::runtime_error where they are not complete within `timeout` [s].
void drawRecord(const std::filesystem::path& record, const std::string& pictures, double timeout);

}  // namespace palpate::apps
