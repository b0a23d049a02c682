// The loop closed over the wire: tissue, stabiliser, packets, bridge, encoders and motors of an emulated Falcon in a hand.
#include <haptics/simulation.h>
#include <tests/falcon/rig.h>
#include <tests/haptics/models.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <cmath>

namespace palpate::falcon {
namespace {

using namespace haptics;

constexpr double cap = 8.5;  // [N]

// The skin is the plane y = 0 of the patient, 10 mm of sphere before it; the grip at z = 150 mm touches it.
constexpr double touching = 0.150;

const SessionModel& block()
{
    static const auto model =
        tests::modelOf(tests::blockScene + "[model]\nlevel = \"spring\"\n[safety]\ndevice = \"falcon\"\n");
    return model;
}

// A session with nothing but the wire between simulation and hand.
struct Session {
    explicit Session(const SessionModel& model = block()) : rig(LinkOptions{}), simulation(model)
    {
        rig.device.makeReady();
        rig.device.hand.tremor = 0.0;
        rig.device.hand.goal = {0.0, 0.0, touching + 0.02};
        rig.link.connect(rig.stop);
        // The session begins with the tool outside the body.
        rig.push(Vec3(0.0), 0.6);
        due = rig.wire.now();
        run(0.6);
    }

    void tick()
    {
        due += tickSeconds;
        while (rig.wire.now() < due) {
            rig.link.exchange(order);
            rig.watch();
        }
        const GripPose& pose = rig.link.pose();
        DeviceSample sample;
        sample.position = {pose.position.x, touching - 10e-3 - pose.position.z, pose.position.y};
        sample.buttons = buttonDeadMan;
        sample.fresh = rig.wire.now() - pose.time < 5e-3;
        const TickRecord& record = simulation.tick(sample);
        const Vec3 force = record.total;
        order = {{force.x, force.z, -force.y}, rig.wire.now(), 1};
        steepest = std::max(steepest, glm::distance(force, last));
        strongest = std::max(strongest, glm::length(force));
        energy = std::max(energy, record.energy);
        last = force;
        finite = finite && std::isfinite(glm::length(force)) && !record.faulted;
    }
    void run(double seconds)
    {
        low = high = rig.device.position();
        for (int i = 0; i < static_cast<int>(seconds / tickSeconds); ++i) {
            tick();
            low = glm::min(low, rig.device.position());
            high = glm::max(high, rig.device.position());
        }
    }
    void move(Vec3 goal, double speed)
    {
        rig.device.hand.goal = goal;
        rig.device.hand.speed = speed;
    }
    /// How far the grip moved to and fro in the last run() [m].
    double swing() const { return glm::distance(low, high); }
    void expectSafe() const
    {
        EXPECT_TRUE(finite);
        EXPECT_LE(strongest, cap + 1e-9);
        EXPECT_LE(rig.largest, largestCommand);
        EXPECT_LT(energy, 1e-3) << "net, that all forces ever gave to the hand [J]";
    }

    Rig rig;
    Simulation simulation;
    ForceOrder order;
    double due = 0;
    Vec3 last{0.0}, low{0.0}, high{0.0};
    double steepest = 0, strongest = 0, energy = 0;
    bool finite = true;
};

TEST(FalconStability, PressedAndHeldItRests)
{
    Session s;
    s.move({0, 0, touching - 0.012}, 0.05);
    s.run(1.5);
    const Vec3 force = s.last;
    EXPECT_GT(glm::length(force), 0.5) << "it does press";
    s.run(1.0);
    EXPECT_LT(s.swing(), 60e-6) << "an encoder step";
    EXPECT_LT(glm::distance(s.last, force), 0.05 * glm::length(force));
    EXPECT_LT(
        glm::distance(s.rig.device.motorForce() - Vec3(0, s.rig.device.weight(), 0), Vec3(s.last.x, s.last.z, -s.last.y)),
        0.03)
        << "and what is sent is what the hand feels";
    s.expectSafe();
}

TEST(FalconStability, LettingGoIsFelt)
{
    Session s;
    s.move({0, 0, touching - 0.012}, 0.05);
    s.run(1.2);
    s.move({0, 0, touching + 0.02}, 0.2);
    s.run(0.8);
    EXPECT_EQ(s.last, Vec3(0.0));
    s.run(0.5);
    EXPECT_LT(s.swing(), 60e-6);
    s.expectSafe();
}

TEST(FalconStability, StabAndSlideStayBounded)
{
    Session s;
    s.move({0, 0, touching - 0.02}, 0.8);
    s.run(0.6);
    for (int i = 0; i < 4; ++i) {
        s.move({i % 2 == 0 ? 0.02 : -0.02, 0.01, touching - 0.015}, 0.15);
        s.run(0.4);
    }
    EXPECT_GT(s.strongest, 1.0);
    s.run(1.0);
    EXPECT_LT(s.swing(), 120e-6) << "two encoder steps, on a slope";
    s.expectSafe();
}

// A wire that loses and garbles bytes and comes late: the force is worse, not wild.
TEST(FalconStability, BadWireMakesNoWildForce)
{
    Session s;
    s.rig.device.mishaps.dropped = 0.002;
    s.rig.device.mishaps.garbled = 0.002;
    s.rig.device.mishaps.latency = 1e-3;
    s.move({0, 0, touching - 0.012}, 0.05);
    s.run(3.0);
    EXPECT_GT(s.strongest, 0.3);
    EXPECT_GT(s.rig.link.counts().unanswered, 10U);
    s.run(1.0);
    EXPECT_LT(s.swing(), 1e-3);
    s.expectSafe();
}

}  // namespace
}  // namespace palpate::falcon
