#pragma once

#include <channel/channel.h>
#include <render/overlay.h>
#include <render/picture.h>
#include <render/viewer.h>

#include <array>
#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace palpate::render {

using Clock = std::chrono::steady_clock;

/// Follows the sessions of one name and keeps a picture up to date with them: attaches, attaches again, says in words what
/// there is to wait for, and measures.
class Follower {
public:
    /// `session` may be empty: then the only session that runs is taken. `result`: file that the session's figures come in
    /// when it has ended; empty: none.
    Follower(std::string session, double wait, std::filesystem::path result = {});

    /// Looks what has come; to be called often. Throws std::runtime_error when there has been no session for `wait`
    /// seconds, or the one that there was has been killed and has not come back.
    void poll(Picture& picture);
    /// Draws what has come, brings it to the screen (`present`), and measures.
    void draw(Picture& picture, Quality quality, const std::function<void()>& present = {});

    /// The session that is followed; null when there is none.
    const channel::Subscriber* session() const noexcept { return subscriber_ ? &*subscriber_ : nullptr; }
    /// How often a session has been attached to.
    std::uint64_t attached() const noexcept { return attached_; }
    /// The last session has ended as it should, and nothing has come since for `wait` seconds.
    bool over() const noexcept;
    /// ... or just now.
    channel::Ending ending() const noexcept { return ending_; }
    const channel::State& state() const noexcept { return state_; }
    /// Names of the structures that the state's distances are about.
    const std::array<channel::Name, channel::maxStructures>& structures() const noexcept { return structures_; }
    /// Whether the state is of a tick.
    bool known() const noexcept { return known_; }
    /// Tissue or tool have moved lately, so that speed counts more than detail.
    bool moving() const noexcept;
    std::uint64_t frames() const noexcept { return frames_; }
    ViewerFigures figures() const;

private:
    void tryAttach(Picture& picture);
    void read();
    void readShape();
    void leave(Picture& picture);
    void giveUp() const;
    void notice(Picture& picture);
    void lookForResult(Picture& picture);

    std::string wanted_, name_;
    double wait_;
    std::filesystem::path result_;
    bool resultShown_ = false;
    std::optional<channel::Subscriber> subscriber_;
    std::unique_ptr<channel::Displaced> displaced_ = std::make_unique<channel::Displaced>();
    std::vector<channel::Displacement> displacedBefore_;  // when tissue moved last
    channel::State state_;
    std::array<channel::Name, channel::maxStructures> structures_{};
    bool known_ = false, fresh_ = false;
    std::uint64_t attached_ = 0;
    bool reshaped_ = false;       // displaced nodes have come that are not in the picture yet
    glm::dvec3 restingTip_{0.0};  // [m]
    channel::State rateFrom_;     // since when ticks are counted
    bool silent_ = false;         // the simulation lives and says nothing
    channel::Ending ending_ = channel::Ending::none;
    std::uint64_t pid_ = 0;
    Clock::time_point since_ = Clock::now();  // without a session
    Clock::time_point moved_ = Clock::now();
    Clock::time_point polled_ = Clock::now();  // start of the work on the present picture
    Clock::time_point checked_{};              // whether there is a session, or it is alive
    std::optional<Clock::time_point> first_;
    Clock::time_point last_{};
    bool flowing_ = false;  // the last picture was of something that moves
    Health health_;
    std::uint64_t frames_ = 0;
    std::vector<double> frameSeconds_;
    std::vector<Shown> shown_;
    double read_ = 0;  // when the state was [s], as monotonic()
};

/// What the scanner has measured of itself, into `figures`.
void addScans(const UltrasoundPicture& ultrasound, ViewerFigures& figures);

}  // namespace palpate::render
