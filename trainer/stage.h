#pragma once

#include <trainer/grip.h>
#include <trainer/state.h>

#include <memory>
#include <string>

namespace palpate::trainer {

/// One picture of the window.
struct Drawn {
    Errand errand = Errand::none;
    double seconds = 0;      // processor and driver, from the input to the finished picture
    bool unsettled = false;  // one more picture is needed, for keys that have come up by now
};

/// A window of GLFW that ImGui draws the trainer's screens into. One at a time. Not part of the interface.
class Stage {
public:
    /// @param width, height  [pixels]; less on a screen that is smaller
    /// Throws std::runtime_error where there is no display with OpenGL 3.2.
    Stage(int width, int height);
    ~Stage();

    /// What draws.
    std::string renderer() const;
    bool closed() const;
    /// Takes back that the window was closed.
    void stay();
    /// Whether keys go to this window.
    bool focused() const;
    /// Has keys go to this window.
    void takeFocus();
    /// Takes in what has happened; waits for something to happen, so long at most [s]. Returns whether something was done
    /// to the window, which a picture is to show.
    bool await(double seconds);
    /// The next picture sees the key that does the same.
    void press(Press what);
    /// Draws the screen that `state` is at, and sees to what was pressed.
    Drawn draw(State& state);
    /// The next picture shows the screen as if it were new.
    void renew();

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::trainer
