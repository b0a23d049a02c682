#pragma once

#include <haptics/falcon/guardian.h>
#include <haptics/falcon/link.h>
#include <haptics/falcon/newest.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

namespace palpate::falcon {

enum class OnUnplug : std::uint8_t { exit, wait };

struct DriverOptions {
    LinkOptions link;
    OnUnplug onUnplug = OnUnplug::exit;
    bool guardian = true;  // only where the transport has a descriptor
};

/// A Falcon that is being talked to: a thread of its own exchanges packets as fast as the Falcon answers. The servo thread
/// never waits for the USB: it reads the newest pose and leaves the newest force.
class Driver {
public:
    /// Makes the Falcon ready, with instructions to its user by `say`. Throws Trouble. Make it before anything that takes
    /// much memory: the guardian forks.
    Driver(std::unique_ptr<Transport> wire, DriverOptions options, Say say, const std::atomic<bool>& stop);
    /// Takes the torque off.
    ~Driver();

    /// The newest pose; `pose` as it was where none can be had at once. Servo thread: allocates nothing, never waits.
    void read(GripPose& pose) const noexcept { pose_.read(pose); }
    /// The force from now on [N], Falcon's frame. Servo thread.
    void write(Vec3 force, bool engaged) noexcept;
    /// The clock of GripPose::time [s].
    double now() const noexcept { return wire_->now(); }

    /// There will be no more poses; problem() says why.
    bool ended() const noexcept { return ended_.load(std::memory_order_acquire); }
    std::string problem() const;
    LinkCounts counts() const noexcept;

private:
    void run() noexcept;
    void talk();
    bool recover();
    void guard(int descriptor) noexcept;

    std::unique_ptr<Transport> wire_;
    DriverOptions options_;
    Say say_;
    std::unique_ptr<Guardian> guardian_;
    Link link_;
    Newest<GripPose> pose_;
    Newest<ForceOrder> order_;
    Newest<LinkCounts> counts_;
    std::atomic<bool> stop_{false}, ended_{false};
    mutable std::mutex guard_;
    std::string problem_;
    std::thread thread_;
};

}  // namespace palpate::falcon
