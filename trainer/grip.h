#pragma once

#include <trainer/running.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::trainer {

/// What a button of a device's grip does in the window.
enum class Press : std::uint8_t {
    activate,  // what has the focus
    next,      // the focus goes on
    previous,
    back  // to the screen before
};

/// What one line of `palpate devices --buttons` says.
struct GripLine {
    std::optional<Press> press;
    std::optional<bool> ready;  // the device listens, or no longer does
};
GripLine gripLine(std::string_view line);

/// Hears the buttons of a device's grip by a command that has the device for as long: it has to be let go before anything
/// else takes the device. Not part of the interface.
class Grip {
public:
    /// @param programs  folder of palpate
    /// @param log       file for what the command prints
    Grip(std::filesystem::path programs, std::filesystem::path log);

    /// Begins to listen, if it does not yet. A command that has ended by itself is not begun again before letGo().
    /// @param firmware  of the device, a file; empty: it runs already
    void listen(const std::string& firmware);
    /// Lets the device go, and waits until it is free.
    void letGo() { command_.reset(); }
    /// The presses since this was last called, in their order.
    std::vector<Press> heard();
    /// Whether a device was there when it was last heard of.
    bool ready() const noexcept { return ready_; }

private:
    std::filesystem::path programs_, log_;
    std::optional<Running> command_;
    std::string firmware_;     // that it was begun with
    std::streamoff read_ = 0;  // of the log
    bool ready_ = false;
};

}  // namespace palpate::trainer
