#pragma once

#include <chainmail/level.h>
#include <haptics/dffb.h>
#include <haptics/monitor.h>
#include <haptics/motion.h>
#include <haptics/probe.h>
#include <haptics/session_model.h>
#include <haptics/stabiliser.h>
#include <haptics/tick.h>
#include <haptics/tip.h>
#include <occupancy/query.h>

#include <array>
#include <memory>
#include <optional>

namespace palpate::haptics {

/// What a simulation takes from elsewhere than the scene.
struct SimulationOptions {
    double period = tickSeconds;             // between samples [s]
    std::optional<DeviceParameters> device;  // that the stabiliser keeps stable; none: the scene's
};

/// Windows, cycles, strain and period of a tick of level `elastic`, by the scene's settings.
/// @param settings  of the scene
/// @param period  of a tick [s]; longer than the usual one it has time for more cycles
chainmail::ElasticOptions elasticOptions(const datasets::ElasticSettings& settings, double period = tickSeconds) noexcept;
/// ElasticOptions::touches of a tool; 0 for a needle.
double touchedBy(const datasets::ToolSpec& tool, const chainmail::ElasticBody& body) noexcept;

/// The mutable half of a session. tick() is a pure function of the model and of the samples so far: the same samples give
/// the same forces, bit for bit, however late they come. It allocates nothing, locks nothing and does no I/O.
class Simulation {
public:
    /// The model must outlive it. Throws std::runtime_error for a scene with a device that is not known or that
    /// datasets::checkScene() refuses, and where the scene's cap or the period is not a positive number.
    explicit Simulation(const SessionModel& model, const SimulationOptions& options = {});
    Simulation(SessionModel&& model, const SimulationOptions& options = {}) = delete;  // a temporary would not outlive it
    Simulation& operator=(Simulation&&) = delete;  // its parts refer to one another: it stays where it is

    /// H3 collide, H4 basic force, deform, H6 monitor, H7 additional force, stabilise. H2 and H5 are the servo loop's.
    const TickRecord& tick(const DeviceSample& device) noexcept;

    /// What the last tick computed; before the first, where the scene's probe is.
    const TickRecord& record() const noexcept { return record_; }
    /// Nodes that are not at rest after the last tick, and the displacement of every node.
    const chainmail::DisplacedLattice& shape() const noexcept { return deformation_.shape(); }
    /// The level in use: the scene's, or a lower one that it stepped down to.
    datasets::ModelLevel level() const noexcept { return level_; }
    /// How often it stepped down: elastic, elastic on small windows, chainmail, spring.
    int stepsDown() const noexcept { return stepsDown_; }
    /// Between samples [s].
    double period() const noexcept { return stabiliserOptions_.period; }
    /// That it was made of.
    const SessionModel& model() const noexcept { return model_; }

private:
    void accept(const DeviceSample& device) noexcept;
    void stepDownIfAsked() noexcept;
    occupancy::Sweep collide() noexcept;
    chainmail::Grip grip() const noexcept;
    chainmail::Reaction deform() noexcept;
    Vec3 contactForce(Vec3 law, const chainmail::Reaction& reaction) const noexcept;
    void placeProbe() noexcept;
    void seeNeedle() noexcept;
    void fire() noexcept;

    const SessionModel& model_;
    volume::Tissue::Reader reader_;
    chainmail::Deformation deformation_;
    chainmail::SpringLevel spring_;
    chainmail::ChainMailLevel chainmail_;
    // Where the scene's level is `elastic`: its own, and the step below it, on small windows; none where its own are as
    // small.
    std::array<std::unique_ptr<chainmail::ElasticLevel>, 2> elastic_;
    datasets::ModelLevel level_;
    int stepsDown_ = 0;
    occupancy::Body body_;
    std::unique_ptr<occupancy::ContactSet> contacts_;
    DeviceSample hand_;  // the device's pose, between encoder steps
    DeviceSample tool_;  // that of the tool: a bent needle's tip is elsewhere
    EncoderState encoder_;
    TipState tip_;
    Probe probe_;
    MonitorState monitor_;
    DffbState dffb_;
    StabiliserOptions stabiliserOptions_;
    StabiliserState stabiliser_;
    std::uint64_t ticks_ = 0;
    Vec3 last_{0.0};          // tip in the tick before [m]
    Vec3 lastAxis_{0, 1, 0};  // and its axis
    PressedButton trigger_{buttonFire};
    TickRecord record_;
};

}  // namespace palpate::haptics
