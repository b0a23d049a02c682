#pragma once

#include <haptics/falcon/firmware.h>
#include <haptics/falcon/kinematics.h>
#include <haptics/falcon/packet.h>
#include <haptics/falcon/transport.h>

#include <atomic>
#include <optional>

namespace palpate::falcon {

struct LinkOptions {
    std::optional<Firmware> firmware;  // none: the Falcon has to have it already
    double weight = 0.98;              // of the grip, that the motors carry: 100 g [N]
    bool home = true;                  // false: counts and buttons are enough, no pose and no force
};

/// The force that the hand is to feel.
struct ForceOrder {
    Vec3 force{0.0};            // Falcon's frame [N]
    double time = 0;            // when it was ordered [s]
    std::uint64_t engaged = 0;  // not 0: forces are on, the green lamp
};

/// Where the grip is.
struct GripPose {
    Vec3 position{0.0};         // Falcon's frame [m]
    std::uint64_t buttons = 0;  // buttonRight | ...
    double time = 0;            // when it came [s]; 0: never
    double margin = 0;          // see Posture
};

struct LinkCounts {
    std::uint64_t exchanges = 0;    // answered
    std::uint64_t unanswered = 0;   // packets sent that got none in time
    std::uint64_t implausible = 0;  // readings no grip can have come to
    std::uint64_t lostBytes = 0;    // that belonged to no packet
};

/// The conversation with one Falcon: firmware, homing, packets. All in one thread.
///
/// The force that is sent is the last one ordered, and the grip's weight, as torques; all scaled together
///   - by a ramp of half a second after forces were off for whatever reason,
///   - by a watchdog: from 10 ms after the order to 50 ms after it, it falls to zero,
///   - by the singularity margin between `wellPosed` and `singular`,
///   - to the largest motor command (the force keeps its direction), and to a tenth of that per millisecond of change;
/// and zero as long as the pose is not known: a packet lost for over 10 ms, counts that a grip cannot have come to (a
/// packet has no checksum), encoders that stand still for two seconds under a force.
class Link {
public:
    static constexpr double ramp = 0.5;                // [s]
    static constexpr double fresh = 10e-3;             // an order or a pose is good for so long [s]
    static constexpr double faded = 50e-3;             // and the force is gone after so long [s]
    static constexpr double answerTime = 8e-3;         // of a packet, before the next is sent [s]
    static constexpr double silence = 0.5;             // after which the Falcon is lost [s]
    static constexpr double homingTime = 60.0;         // of the user [s]
    static constexpr double moveTime = 20.0;           // of the user, to move the grip [s]
    static constexpr int attempts = 3;                 // with a full reopen between them
    static constexpr double commandPerSecond = 4.1e5;  // most change of a motor command

    Link(Transport& wire, LinkOptions options, Say say);

    /// Opens the Falcon, loads the firmware where it does not run, has the user home it, sees that every encoder moves.
    /// Tries again from the start, with everything closed in between, where that may help. Throws Trouble.
    void connect(const std::atomic<bool>& stop);

    /// Sends a packet and waits for its answer, at most `answerTime`. False when none came.
    bool exchange(const ForceOrder& order) noexcept;
    /// No torque, no lamps: until the Falcon has answered that, or for 30 ms.
    void rest() noexcept;
    void close() noexcept;

    /// No answer for `silence`, or unplugged.
    bool lost() const noexcept;
    /// Encoders stand still under a force.
    bool frozen() const noexcept { return frozen_; }
    const GripPose& pose() const noexcept { return pose_; }
    const Reading& reading() const noexcept { return reading_; }
    const Command& command() const noexcept { return command_; }  // sent last
    const LinkCounts& counts() const noexcept { return counts_; }
    bool loaded() const noexcept { return loadedNow_; }  // the firmware was loaded by connect()

private:
    void attempt(bool reload, const std::atomic<bool>& stop);
    bool answers() noexcept;
    void start(bool reload, const std::atomic<bool>& stop);
    void homeGrip(const std::atomic<bool>& stop);
    void seeEncodersMove(const std::atomic<bool>& stop);
    bool send(const Command& command) noexcept;
    bool listen(double seconds) noexcept;
    bool accept(const Reading& reading) noexcept;
    void noteMotion() noexcept;
    Triple motorFor(const ForceOrder& order, double now) noexcept;
    Triple slewed(const Triple& wanted, double now) noexcept;

    Transport& wire_;
    LinkOptions options_;
    Say say_;
    PacketStream stream_;
    Reading reading_;
    double heard_ = 0;    // when the last reading was accepted [s]
    Reading candidate_;   // not plausible after reading_
    int candidates_ = 0;  // in a row that follow each other
    GripPose pose_;
    std::optional<Posture> posture_;
    Command command_;
    double sent_ = 0;  // [s]
    bool wasHomed_ = false;
    double forcesOff_ = 0;     // when they were off last [s]
    Triple least_{}, most_{};  // counts since the start
    Reading still_;            // the counts, and since when they stand still [s]
    double stillSince_ = 0;
    bool frozen_ = false;
    bool loadedNow_ = false;
    LinkCounts counts_;
};

}  // namespace palpate::falcon
