#pragma once

#include <haptics/score.h>

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace palpate::haptics {

/// Points that a session lost for one reason.
struct Loss {
    std::string measure;       // the key of the measure that says most about it
    double points = 0;         // of 100
    std::string words;         // a sentence, without its full stop
    std::optional<double> at;  // when it happened, of the session [s]; nothing: at no one moment
};

/// Scores a session tick by tick, as Scorer does, and remembers when points were lost and where the best core lay. For a
/// live session and a record alike. add() allocates nothing.
class LossWatch {
public:
    explicit LossWatch(const SessionInfo& info);
    void add(const TickRecord& record) noexcept;
    Score score() const noexcept { return scorer_.score(); }
    /// Of the scorer.
    std::span<const Vec3> marks() const noexcept { return scorer_.marks(); }

    /// All losses, the largest first. With the total their points add up to 100. Allocates.
    /// @param info  that of the constructor: names of structures
    std::vector<Loss> losses(const SessionInfo& info) const;

private:
    /// Moments that can be jumped to.
    enum Moment : std::uint8_t {
        shot,
        secondShot,
        touch,
        secondContact,
        redirect,
        force,
        beyond,
        mark,
        blind,
        pierced,
        refusal,
        boneRefusal,
        moments
    };

    void note(Moment moment, bool now, double seconds) noexcept;
    std::optional<double> at(Moment moment) const noexcept;
    std::string miss(const Score& score, const SessionInfo& info, const std::string& target) const;
    Loss ofNoCore(const SessionInfo& info) const;
    std::vector<Loss> ofBiopsy(const Score& score, const SessionInfo& info) const;
    std::vector<Loss> ofPalpation(const Score& score, const SessionInfo& info) const;
    std::vector<Loss> ofRest(const Score& score) const;
    std::vector<Loss> ofWay(const Score& score, const SessionInfo& info) const;
    std::vector<Loss> ofTask(const Score& score, const SessionInfo& info) const;
    Loss ofContacts(const Score& score, double most) const;
    Loss ofForce(const Score& score, double points) const;
    Loss ofRedirects(const Score& score, double most) const;
    Loss ofPath(const Score& score, double most) const;
    Loss ofBeyond(const Score& score, double most, const std::string& target) const;

    double rate_ = 1000;  // [Hz]
    Scorer scorer_;
    Score before_;                      // after the tick before
    std::array<double, moments> at_{};  // [s]; below 0: never
    CoreSample core_;                   // the best
    Event stop_;                        // of its throw by bone; another kind: it was not stopped
    std::uint8_t bone_ = 0;             // at which the gun was refused first
    std::uint8_t touched_ = 0xFF;       // the vital structure that was touched first
    std::optional<TargetShape> target_;
};

/// The losses of a whole record, as LossWatch::losses().
std::vector<Loss> lossesOf(const Record& record);

/// "-12 points: No core hit the tumour (at 4.2 s)".
std::string inWords(const Loss& loss);

/// Where somebody finds a place, e.g. "towards the feet and the patient's left"; empty for a shorter way than 1 mm.
/// @param way  patient frame [m]
std::string directionInWords(Vec3 way);

}  // namespace palpate::haptics
