#pragma once

#include <render/mouse_hand.h>
#include <render/picture.h>
#include <render/space_mouse.h>
#include <render/tryout.h>
#include <render/viewer.h>

#include <glm/vec2.hpp>

#include <vtkGenericRenderWindowInteractor.h>

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

struct GLFWwindow;

namespace palpate::render {

/// What keys and mouse do in a window: the hand, the camera, what is shown, and a record that is played.
///
///     session with a hand of a viewer   left: hold to move the tool, wheel: along itself; right: camera
///                                       keys: Enter takes the tool and lets it go, arrows and pages move it
///     any other session                 left or right: camera, wheel: zoom
///     record                            left: drag through the time, right: camera, wheel: zoom
///
/// On the ultrasound picture: left measures, right moves the probe, wheel: depth.
///
/// Middle shifts the camera. What keys do is in keys.cpp.
class Controls {
public:
    /// Listens to `window` until it is destroyed. All must outlive that.
    Controls(GLFWwindow* window, vtkGenericRenderWindowInteractor& interactor, Picture& picture, const Follower& follower,
             const ViewerOptions& options);
    Controls& operator=(Controls&&) = delete;

    /// To be called after every look at the follower.
    void keep();
    /// Whether something was used since the last call.
    bool used() noexcept { return std::exchange(used_, false); }
    bool holding() const noexcept { return hand_.held(); }

    struct Press {
        int sign;  // of the stroke
        bool shift;
        int value;  // of the stroke
        bool control = false;
    };
    static constexpr int once = 0;  // instead of a sign: a key that is held down does not repeat
    struct Stroke {
        int key = 0;  // GLFW_KEY_..; 0: by its name on this keyboard
        char name = 0;
        int sign = 1;   // of two keys that do opposite things
        int value = 0;  // of several that do the same to different things
        bool alt = false;
    };
    // What else a key needs, added to its windows: a body with a CT or MR, the ultrasound picture that is shown, a scene
    // with CT or one without, a needle as the tool, a probe that this window may move, one that no scene holds, a body that
    // is not closed to who looks, and one that is not closed to who holds the tool (Picture::isClosed()).
    static constexpr unsigned ofImage = 16, ofUltrasound = 32, ofCt = 64, ofNeedle = 128, ofProbe = 256, ofFreeProbe = 512,
                              withoutCt = 1024, ofOpenBody = 2048, ofLayouts = 4096;
    struct Key {
        unsigned windows;  // kinds, added up
        const char* shown;
        const char* what;
        std::vector<Stroke> strokes = {};
        void (*act)(Controls&, const Press&) = nullptr;
    };
    /// The one list of them.
    static const std::vector<Key> keys;

private:
    // What keys do that ask for nothing more.
    template <auto Do>
    static void here(Controls& c, const Press&)
    {
        (c.*Do)();
    }
    template <auto Do>
    static void onHand(Controls& c, const Press&)
    {
        (c.hand_.*Do)();
    }
    template <auto Do>
    static void onPicture(Controls& c, const Press&)
    {
        (c.picture_.*Do)();
    }
    template <auto Do>
    static void onScan(Controls& c, const Press&)
    {
        (c.picture_.ultrasound().*Do)();
    }
    template <Knob what>
    static void turn(Controls& c, const Press& p)
    {
        c.picture_.ultrasound().turn(what, p.shift ? -1 : 1, p.value);
    }

    // The picture's directions at the hand [m]: to the right and up on the screen, and into it. Unit vectors.
    struct Screen {
        glm::dvec3 right, up, into;
    };
    /// @param button  GLFW's, for a mouse in the right hand
    void button(int button, bool down);
    void moved(glm::dvec2 to, bool fine);
    void wheel(double notches, bool fine, bool intoPicture);
    void key(int key, const std::string& name, bool again, int mods);
    void toggleHold();
    void moveProbe(const ultrasound::ProbeMove& by);
    void storePicture();
    void fire();
    void step(glm::dvec3 direction, double steps, bool fine);
    bool applies(const Key& key) const;
    bool sceneHoldsProbe() const;
    std::vector<KeyHelp> help() const;
    Screen screen() const;
    void jumpBy(double seconds);
    double shownTime() const;
    void scrub();
    bool onUltrasound() const;
    // On a live picture the mouse that is the hand leads the needle.
    bool measures() const { return !hand_.is() || picture_.ultrasound().frozen(); }
    void camera(unsigned long event);
    void showHelp();
    void close();
    bool asksToClose() const;
    std::string caption() const;

    GLFWwindow* window_;
    vtkGenericRenderWindowInteractor& interactor_;
    Picture& picture_;
    const Follower& follower_;
    Playback* playback_;
    std::filesystem::path images_;  // folder for stored ultrasound pictures
    MouseHand hand_;
    SpaceMouse spaceMouse_;
    glm::dvec2 cursor_{0.0};  // [pixels], from the lower left
    bool steps_ = true;       // are told in words
    bool leftHanded_ = false;
    bool watches_ = false;  // only
    std::optional<Tryout> tryout_;
    std::optional<Clock::time_point>
        closing_;  // when the window was to close, which ends a session if it is asked for again
    bool used_ = false, helping_ = false, scrubbing_ = false;
    bool measuring_ = false, probing_ = false;  // on the ultrasound picture
    bool byKey_ = false;                        // a key has taken the tool: the mouse leaves it alone
};

}  // namespace palpate::render
