#pragma once

#include <haptics/losses.h>
#include <haptics/recorder.h>
#include <haptics/replay.h>
#include <haptics/score.h>
#include <haptics/servo.h>
#include <haptics/session_model.h>
#include <haptics/simulation.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <vector>

namespace palpate::session {

/// What a session came to, from all its ticks.
struct SessionFigures {
    haptics::Score score;                                  // of all ticks so far
    std::vector<haptics::Loss> losses;                     // where its points went, the largest first
    std::vector<haptics::Loss> lossesInEnglish;            // the same, whatever language the session's window has
    std::vector<haptics::CoreSample> cores;                // at most 64, in their order
    std::array<double, haptics::maxStructures> nearest{};  // least distance to each structure [m]
    std::uint64_t contacts = 0;                            // events: the tool touched the body
    std::uint64_t punctures = 0;                           // events: a tissue gave way
    double peakBasic = 0;                                  // largest force of the tissue, as sent [N]
    double peakAdditional = 0;                             // largest guiding force [N]
    double peakTotal = 0;                                  // largest of their sums, as sent [N]
    double energyMade = 0;                                 // most that the hand was ever given net [J]
    double energyDamped = 0;                               // taken by the controller [J]
    std::uint64_t forceHash = 0;                           // of all forces, see haptics::ForceHash
    bool faulted = false;                                  // a force or a pose was not finite: the force was switched off
    int stepsDown = 0;                                     // to a cheaper model, as ticks came late
    double steppedDownAt = 0;                              // the first time, in session time [s]
    datasets::ModelLevel level{};                          // in use at the end
};

/// How a session is run, and what hears of it beside.
struct RunOptions {
    haptics::ServoOptions servo;              // pace and length
    haptics::Recorder* recorder = nullptr;    // gets every tick; null: none
    const std::atomic<bool>* stop = nullptr;  // set: the session ends after the tick; null: it runs to its end
};

/// A session in the calling thread: poses in, ticks out, and what they came to. `palpate train`, sweeps and studies run
/// theirs with it. Between construction and figures() it allocates nothing.
class Session {
public:
    /// @param model  must outlive the session
    /// @param info   of this model, see describeSession(): what the score goes by, and the rate of its ticks
    /// Throws std::runtime_error for a scene with a device that is not known, and where the rate or the scene's cap is not
    /// a positive number.
    Session(const haptics::SessionModel& model, const haptics::SessionInfo& info);
    Session(haptics::SessionModel&&, const haptics::SessionInfo&) = delete;  // a temporary would not outlive it
    Session& operator=(Session&&) = delete;  // is neither copied nor moved: std::deque and std::unique_ptr hold several

    /// One tick, a millisecond unless `info` has another rate: the pose of the tool in, forces and events out. The same
    /// poses give the same ticks, bit for bit.
    /// @returns  valid until the next tick
    const haptics::TickRecord& tick(const haptics::DeviceSample& pose) noexcept;

    /// tick() after tick() until the device has finished, the time is over or the session is told to stop. See
    /// haptics::runServo().
    /// @param device   gives the poses and gets the forces
    /// @param options  pace and length, recorder, how to stop it
    /// @param also     gets every tick after the recorder; must not allocate, lock or block in a paced session; may be
    /// empty
    haptics::ServoTiming run(haptics::Device& device, const RunOptions& options, const haptics::TickSink& also = {});

    /// What viewers are shown: shape of the tissue, level, model.
    const haptics::Simulation& simulation() const noexcept { return simulation_; }
    /// Of the ticks so far. Allocates.
    SessionFigures figures() const;

private:
    void add(const haptics::TickRecord& record) noexcept;

    haptics::Simulation simulation_;
    haptics::SessionInfo info_;
    haptics::LossWatch watch_;
    haptics::ForceHash hash_;
    SessionFigures figures_;
};

}  // namespace palpate::session
