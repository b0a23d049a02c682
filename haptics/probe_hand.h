#pragma once

#include <datasets/phantom_random.h>
#include <datasets/probe.h>
#include <haptics/tick.h>
#include <haptics/trainee_skill.h>

#include <cstdint>

namespace palpate::haptics {

/// The other hand of a scripted trainee: it holds the ultrasound probe, and wanders. At a look at the picture it takes the
/// plane back to the needle, as well as its skill allows. Its chances are its own, so that a trainee does the same with its
/// needle whether there is a probe or not.
class ProbeHand {
public:
    /// @param probe  of the scene; of kind `none` it does nothing
    /// @param skill  how well it holds the plane on the needle
    /// @param seed   of the session
    ProbeHand(const datasets::ProbeSpec& probe, const Skill& skill, std::uint64_t seed);

    bool holds() const noexcept { return holds_; }
    /// Begins to take the picture's plane back to the needle as it was seen last.
    void look() noexcept;
    /// The look is over, and the tip is still not in the picture: whether this trainee sees that it must look again.
    bool wantsAnother() noexcept;
    /// Whether this trainee thinks of storing a picture now.
    bool stores() noexcept { return holds_ && random_.between(0.0, 1.0) < skill_.vigilance; }

    void observe(const TickRecord& record) noexcept;
    /// One tick on: where it has the probe, beside the scene's script.
    datasets::ProbeMove read() noexcept;

    static constexpr double lookTime = 0.3;  // that taking the plane back lasts, assumed [s]

private:
    double normal() noexcept;

    bool holds_;
    Skill skill_;
    datasets::Random random_;
    datasets::ProbeMove move_, from_, to_;
    double inLook_ = lookTime;
    double wander_ = 0;  // across the picture [m/s]
    bool sees_ = false;
    // The needle as the picture has it: across the plane and along the face, of its tip and further up its shaft [m].
    double tipAcross_ = 0, tipAlong_ = 0, shaftAcross_ = 0, shaftAlong_ = 0;
};

}  // namespace palpate::haptics
