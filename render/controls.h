#pragma once

#include <render/mouse_hand.h>
#include <render/picture.h>
#include <render/viewer.h>

#include <glm/vec2.hpp>

#include <vtkGenericRenderWindowInteractor.h>

#include <string>
#include <vector>

struct GLFWwindow;

namespace palpate::render {

/// What keys and mouse do in a window: the hand, the camera, what is shown, and a record that is played.
///
///     session with a hand of a viewer   left: hold to move the tool, wheel: its depth; right: camera
///     any other session                 left or right: camera, wheel: zoom
///     record                            left: drag through the time, right: camera, wheel: zoom
///
/// Middle shifts the camera. help() lists the keys.
class Controls {
public:
    /// Listens to `window` until it is destroyed. All must outlive that. @param playback  of a record; null = a live
    /// session
    Controls(GLFWwindow* window, vtkGenericRenderWindowInteractor& interactor, Picture& picture, const Follower& follower,
             Playback* playback);
    Controls(const Controls&) = delete;
    Controls& operator=(const Controls&) = delete;

    /// To be called after every look at the follower.
    void keep();
    /// Whether something was used since the last call.
    bool used() noexcept;
    bool holding() const noexcept { return hand_.held(); }

private:
    void button(int button, bool down);
    void moved(glm::dvec2 to, bool fine);
    void wheel(double notches, bool fine);
    void key(int key, const std::string& name, bool again, bool shift);
    bool pictureKey(int key, const std::string& name, bool shift);
    void handKey(int key, const std::string& name, bool again);
    void playKey(int key, const std::string& name, bool shift);
    void scrub();
    void camera(unsigned long event);
    void showHelp();
    std::vector<KeyHelp> help() const;
    std::string caption() const;

    GLFWwindow* window_;
    vtkGenericRenderWindowInteractor& interactor_;
    Picture& picture_;
    const Follower& follower_;
    Playback* playback_;
    MouseHand hand_;
    glm::dvec2 cursor_{0.0};  // [pixels], from the lower left
    bool used_ = false, helping_ = false, scrubbing_ = false;
};

}  // namespace palpate::render
