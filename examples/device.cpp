// A device of one's own: a hand that taps the block three times a second. It runs in the servo loop of every session.
#include <palpate/haptics/device.h>
#include <palpate/session/open.h>
#include <palpate/session/session.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <numbers>

using namespace palpate;

namespace {

class Tapper final : public haptics::Device {
public:
    explicit Tapper(double radius) : radius_(radius) {}

    // Once a millisecond: allocates nothing, waits for nothing.
    haptics::DeviceSample read() noexcept override
    {
        const double time = haptics::tickSeconds * static_cast<double>(tick_++);
        const double depth = 3e-3 * std::sin(2.0 * std::numbers::pi * 3.0 * time);
        return {.position = {0, depth - radius_, 0}, .buttons = haptics::buttonDeadMan};
    }
    void write(Vec3 force) noexcept override { largest_ = std::max(largest_, -force.y); }
    bool finished() const noexcept override { return tick_ >= 2000; }

    double largest() const noexcept { return largest_; }

private:
    double radius_;
    double largest_ = 0;
    int tick_ = 0;
};

}  // namespace

int main()
{
    try {
        const haptics::SessionModel model = session::openSession("block", {});
        session::Session session(model, session::describeSession(model, "block", "tapper"));
        Tapper tapper(model.scene.tool.radius);
        session.run(tapper, {.servo = {.paced = false}});  // paced: one tick per millisecond, as a hand needs it
        std::printf("the largest force on the hand was %.3f N\n", tapper.largest());
        return tapper.largest() > 0.0 ? 0 : 1;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "device: %s\n", e.what());
        return 1;
    }
}
