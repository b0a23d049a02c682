#pragma once

#include <haptics/arm.h>
#include <haptics/device.h>
#include <haptics/motor.h>
#include <haptics/probe_hand.h>
#include <haptics/session_model.h>
#include <haptics/trainee_skill.h>

#include <cstdint>

namespace palpate::haptics {

/// A hand with eyes: takes a biopsy under view. It sets the needle on the skin, pushes through, advances in minimum-jerk
/// movements (Flash and Hogan, "The coordination of arm movements", J. Neuroscience 5, 1985) with a look at the picture
/// after each, looks once more, fires, draws back and judges the core; when that is too poor it goes again. When it sees
/// that the needle's line misses, or a vital structure is very near, it draws back inside the body and takes another line.
/// Where the scene asks to touch the skin or to advance, it does that and fires nothing.
///
/// What it does follows from what it sees and feels, its skill and its seed: same seed, same session, bit for bit. In the
/// loop it allocates nothing.
class Trainee final : public Device {
public:
    /// The model must outlive it. Begins `distance` [m] outside the body on its planned line.
    Trainee(const SessionModel& model, const Skill& skill, std::uint64_t seed, double distance);

    DeviceSample read() noexcept override;
    void write(Vec3 force) noexcept override { arm_.write(force); }
    void observe(const TickRecord& record) noexcept override;
    bool finished() const noexcept override { return act_ == Act::done; }

private:
    enum class Act : std::uint8_t {
        approach,
        touch,
        rest,
        pierce,
        advance,
        look,
        check,
        fire,
        drawBack,
        retreat,
        judge,
        done
    };

    Vec3 scatter(double deviation) noexcept;
    void plan(double keep) noexcept;
    void begin(Act act) noexcept;
    void go(Vec3 to, Vec3 axis) noexcept;
    void stroke() noexcept;
    void takeAnotherLine() noexcept;
    void followLeg() noexcept;
    void advanceAct() noexcept;
    void afterCheck() noexcept;
    void afterCore() noexcept;
    bool arrived() const noexcept;
    bool isDeepEnough() const noexcept;
    bool dangerAhead() const noexcept;
    Vec3 inward() const noexcept { return glm::normalize(aim_ - entry_); }
    double depthToFire() const noexcept;
    bool asks(datasets::SessionTask task) const noexcept { return model_.scene.task == task; }
    void storePicture() noexcept;

    const SessionModel& model_;
    Skill skill_;
    double distance_;  // it draws back to, outside the body [m]
    datasets::Random random_;
    Arm arm_;
    Tremor tremor_;
    ProbeHand probe_;
    Act act_ = Act::approach;
    double inAct_ = 0;  // time since it began [s]
    // Its plan: where it means to go in and what it takes for the middle of the target [m].
    Vec3 entry_{0.0}, aim_{0.0}, aimError_{0.0};
    // The movement in progress.
    Vec3 from_{0.0}, to_{0.0}, goal_{0.0}, fromAxis_{0.0}, toAxis_{0.0}, axis_{0.0};
    double duration_ = 0;  // [s]
    // What it has seen.
    double inserted_ = 0;  // [m]
    LookAhead ahead_;
    double insideSince_ = -1, touchingSince_ = -1, warnedSince_ = -1;  // for so long [s]; below 0: not
    double bestCore_ = 0;                                              // fraction of target
    std::uint64_t ticks_ = 0;
    int fired_ = 0, entries_ = 0, redirects_ = 0, strokes_ = 0, looks_ = 0;
    double storing_ = 0;  // the button that stores a picture stays down so long yet [s]
};

}  // namespace palpate::haptics
