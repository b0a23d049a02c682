#pragma once

#include <haptics/arm.h>
#include <haptics/falcon/kinematics.h>
#include <haptics/falcon/packet.h>
#include <haptics/falcon/transport.h>

#include <cstdint>
#include <deque>
#include <random>
#include <span>
#include <vector>

namespace palpate::falcon {

/// What goes wrong with an emulated Falcon while it is set.
struct Mishaps {
    bool mute = false;         // nothing but status comes back
    bool stalled = false;      // the processor stops answering packets; torque stays
    bool frozen = false;       // encoders keep their counts
    bool homeless = false;     // no leg finds its zero, and readings say so
    bool neverRuns = false;    // the firmware is taken and does not begin
    bool leadingZero = false;  // before the loader's greeting
    bool wrongGreeting = false;
    long wrongEcho = -1;  // byte of the upload that comes back changed
    double garbled = 0;   // fraction of the bytes that come in changed
    double dropped = 0;   // fraction of the bytes that come in missing
    double latency = 0;   // more of it, until an answer can be fetched [s]
};

/// The hand at the grip: where it wants it, how it goes there.
struct Hand {
    Vec3 goal{0.0, 0.0, 0.13};  // Falcon's frame [m]
    double speed = 0.15;        // [m/s]
    double tremor = 50e-6;      // [m]
    std::uint8_t buttons = 0;
    bool obeys = true;  // pulls the grip out when the Falcon is being homed, moves it when it has started
};

/// A Novint Falcon in software, from the serial bridge inwards: control requests, firmware loader with its echo, packets,
/// encoders and motors on a delta arm with mass, friction and a hand. It has no watchdog of its own: the torque that was
/// commanded last stays, the worst that a real one could do. Time is what advance() makes of it.
class Emulator {
public:
    /// @param firmware  the image that its processor runs; none other    @param seed  of its mishaps
    explicit Emulator(std::vector<std::uint8_t> firmware, std::uint64_t seed = 1);

    Mishaps mishaps;
    Hand hand;

    void advance(double seconds);
    double now() const noexcept { return time_; }

    /// False: a request that the bridge does not know (a stall on the wire).
    bool control(std::uint8_t request, std::uint16_t value);
    void put(std::span<const std::uint8_t> bytes);
    /// The next packet that comes in, status first: what there is once it fills a packet or the latency timer has run out.
    /// Empty: nothing yet.
    std::vector<std::uint8_t> take(std::size_t most = usbPacket);

    /// The power supply: off, the firmware and the zeros are gone.
    void powerCycle();
    /// As if its firmware were loaded and its user had homed it.
    void makeReady();

    bool running() const noexcept { return state_ == State::running; }
    std::uint8_t homed() const noexcept { return homed_; }
    const Command& command() const noexcept { return command_; }  // that the motors carry out
    std::uint64_t packets() const noexcept { return packets_; }   // answered
    Vec3 position() const noexcept { return arm_.position(); }    // of the grip [m]
    Vec3 motorForce() const noexcept { return motorForce_; }      // of the motors on the grip, by J^-T [N]
    double weight() const noexcept { return weight_; }            // of the grip [N]

private:
    enum class State : std::uint8_t { waiting, greeted, loading, booting, running };
    struct Byte {
        double ready = 0;  // [s]
        std::uint8_t value = 0;
    };

    void hear(std::uint8_t byte);
    void hearLoader(std::uint8_t byte);
    void answer(const Command& command);
    void reply(std::uint8_t byte, double delay);
    void live(double seconds);
    void moveHand(double seconds);
    double byteTime() const noexcept;
    bool chance(double fraction);

    std::vector<std::uint8_t> firmware_;
    std::mt19937_64 random_;
    double time_ = 0;
    double lived_ = 0;  // how far the arm has [s]
    // The bridge.
    std::uint16_t baud_ = bridge::baud9600;
    double latency_ = 16e-3;  // [s]
    double flushed_ = 0;      // when the latency timer ran out last [s]
    std::deque<Byte> arriving_, leaving_;
    bool dtr_ = false, dtrRose_ = false, rts_ = true;
    // The processor.
    State state_ = State::waiting;
    std::deque<std::uint8_t> heard_;
    std::vector<std::uint8_t> image_;
    double booted_ = 0;  // when it begins to run [s]
    PacketStream stream_;
    Command command_;
    std::uint8_t homed_ = 0;
    std::uint64_t packets_ = 0;
    // The arm.
    haptics::DeviceParameters parameters_;
    haptics::Arm arm_;
    double weight_ = 0.98;
    Vec3 goal_;
    Vec3 motorForce_{0.0};
    Triple count_{}, offset_{};  // as the encoders say it; offset_ while there is no zero
};

}  // namespace palpate::falcon
