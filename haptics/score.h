#pragma once

#include <haptics/recorder.h>
#include <haptics/session_model.h>
#include <haptics/tick.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace palpate::haptics {

/// What the 50 points of part `core` are for: a core, marks of a palpation, resting on the skin, bringing the tip into the
/// target; or for nothing, where the tool can do none of what the scene asks for.
enum class Judged : std::uint8_t { core, marks, rest, way, nothing };
inline constexpr std::array<std::string_view, 5> judgedNames{"core", "marks", "rest", "way", "nothing"};  // in --json

/// What simulators of needle procedures score (Johnson 2012 and the list in docs/score.md), computed tick by tick.
struct Score {
    datasets::SceneAim aim;   // what the scene asks for
    double seconds = 0;       // first contact to the end
    double rest = 0;          // on the skin, and not inside [s]
    double pathLength = 0;    // of the tip, in steps of 0.2 mm [m]
    double insertedPath = 0;  // of the tip while inside [m]
    double deepest = 0;       // largest length of the shaft inside [m]
    double beyondTarget = 0;  // how much deeper the shaft went in than where the tip was in, or nearest to, the target [m]
    double peakForce = 0;     // total [N]
    double meanForce = 0;     // total, while in contact [N]
    /// Least distance from the tip to the target while inside, 0 in it [m]; infinite when never inside.
    double tipToTarget = std::numeric_limits<double>::infinity();
    std::uint32_t skinContacts = 0;  // after at least 0.1 s off the body
    std::uint32_t redirects = 0;     // withdrawn by over 5 mm inside and pushed on again by over 5 mm
    std::uint32_t passes = 0;        // fired
    /// Middle of the notch to target's surface, 0 inside the target, at the best firing [m]: the one whose core has the
    /// most points, then the largest share of target, then the smallest error. Not finite when never fired.
    double targetingError = std::numeric_limits<double>::infinity();
    double bestTargetFraction = 0;  // of the core of that firing
    double bestTargetLength = 0;    // [m]
    std::uint32_t vitalContacts = 0;
    double vitalSeconds = 0;  // time with the tool's surface in a vital structure
    double vitalDepth = 0;    // of the surface in it, deepest [m]
    /// From the tool's surface to the nearest vital structure while inside and in the gun's throws, below 0 in it [m];
    /// infinite when never inside or without one.
    double vitalMargin = std::numeric_limits<double>::infinity();
    std::uint32_t warnings = 0;
    double jerk = 0;        // root mean square of the tip's, below 20 Hz, while in contact [m/s^3]
    double tissueWork = 0;  // that the tool did on the tissue: cutting, rubbing and what is still bent [J]
    // Palpation: the middle of the places that the trainee marked, and the largest distance between two of them.
    std::uint32_t marks = 0;
    double markError = std::numeric_limits<double>::infinity();      // from the target's middle, across the tool [m]
    double markSizeError = std::numeric_limits<double>::infinity();  // of the diameter, without its sign [m]
    // Ultrasound, where the scene holds a probe.
    bool hasProbe = false;
    double probeSeconds = 0;  // time with the probe on the skin; only level `elastic` knows it
    double needleInBeam = 0;  // of the shaft in tissue, what the picture has: mean over the time inside [m]
    double needleShare = 0;   // the same as a fraction of the shaft in tissue
    double minInBeam = 0;     // least of it while the needle goes on at over 10 mm inside [m]
    double tipShare = 0;      // of the time inside, with the tip in the picture
    double blindAdvance = 0;  // way that the needle went on inside without its tip in the picture [m]
    std::uint32_t picturesBefore = 0,
                  picturesAfter = 0;  // stored with the needle inside before the first shot; after a shot
    // CT, where the scene has it.
    double scanDose = 0;  // of one scan [mGy cm]; 0: the scene has no CT
    std::uint32_t scans = 0;
    double total = 0;  // 0-100; the formula is in score.cpp and docs/score.md
};

Judged judgedBy(const Score& score) noexcept;

/// Where the points of a total come from.
struct ScoreParts {
    double core = 0;       // of 50, see Judged
    double vital = 0;      // of 25
    double technique = 0;  // of 25
};

ScoreParts parts(const Score& score) noexcept;

/// What points are given for, each as a share from 0 (nothing) to 1 (all of it): parts() weighs them.
struct ScoreShares {
    double hit = 0;       // enough target in the best core for technique to count
    double stays = 0;     // not pushed beyond the target
    double passes = 0;    // few of them
    double contacts = 0;  // few touches of the skin
    double redirects = 0;
    double economy = 0;  // of the path inside
    double gentle = 0;   // small forces
    double seen = 0;     // with a probe: the tip is in the picture while it goes on
    double place = 0;    // of the marks
    double near = 0;     // enough for their size and technique to count
    double size = 0;     // between the marks
    double light = 0;    // of a touch: small forces
    double rested = 0;   // for as long as was asked for
    double whole = 0;    // the skin was not pierced
    double reached = 0;  // the tip was in the target, or near it
};
ScoreShares sharesOf(const Score& score) noexcept;

/// Length of a path, counted in steps of at least 0.2 mm so that noise of an encoder adds nothing; the last, shorter step
/// counts too.
struct PathMeter {
    Vec3 anchor{0.0};
    double counted = 0;  // [m]
    bool running = false;

    void add(Vec3 tip) noexcept;
    /// Ends a stretch; the next add() starts another one.
    void pause(Vec3 tip) noexcept;
    double length(Vec3 tip) const noexcept { return running ? counted + glm::distance(anchor, tip) : counted; }
};

/// Root mean square jerk of a path, from means over 25 ms: what an encoder's steps add stays below what a tremor has.
struct JerkMeter {
    std::array<Vec3, 4> means{};  // of the last blocks, newest last [m]
    Vec3 sum{0.0};
    int ticks = 0;   // in the block that fills
    int blocks = 0;  // whole ones so far, at most 4
    double squares = 0;
    std::uint64_t count = 0;

    void add(Vec3 tip, double rate) noexcept;
    /// The next add() starts another stretch.
    void pause() noexcept;
    double rms() const noexcept { return count > 0 ? std::sqrt(squares / static_cast<double>(count)) : 0.0; }  // [m/s^3]
};

/// The target at rest: what a palpation is judged by, and what a report draws. SessionInfo::extra keeps it.
struct TargetShape {
    Vec3 middle{0.0};     // patient frame [m]
    Vec3 axis{0, 1, 0};   // of the tool: places are compared across it
    double diameter = 0;  // of the sphere of its volume [m]
};
TargetShape shapeOfTarget(const SessionModel& model);
inline constexpr const char* targetShapeKey = "target_shape";
std::string toText(const TargetShape& shape);
/// What the record of a session says; nothing where it does not.
std::optional<TargetShape> targetShapeOf(const SessionInfo& info);

/// Key of SessionInfo::extra: radius of the tool [mm].
inline constexpr const char* toolRadiusKey = "tool_radius_mm";
/// What the record of a session says [m]; 0 where it says nothing: distances then count from the tip.
double toolRadiusOf(const SessionInfo& info);

/// Key of SessionInfo::extra: dose-length product of one CT scan [mGy cm], of a scene with [ct].
inline constexpr const char* scanDoseKey = "ct_scan_mgy_cm";
/// What the record of a session says of it; 0 where it says nothing.
double scanDoseOf(const SessionInfo& info);

/// Feeds on ticks, in a live session and from a record alike.
class Scorer {
public:
    explicit Scorer(const SessionInfo& info);
    void add(const TickRecord& record) noexcept;
    Score score() const noexcept;
    /// What add() counts as it stands: what score() computes from it (times, lengths, means, marks, total) is missing.
    const Score& counted() const noexcept { return score_; }
    /// Where the tool was at the marks that count [m].
    std::span<const Vec3> marks() const noexcept { return {marks_.data(), score_.marks}; }

private:
    void addContact(const TickRecord& record) noexcept;
    void addTip(const TickRecord& record) noexcept;
    void addDepth(const TickRecord& record) noexcept;
    void addBeyond(const TickRecord& record) noexcept;
    void addFiring(const TickRecord& record) noexcept;
    void addVital(const TickRecord& record) noexcept;
    void addWork(const TickRecord& record) noexcept;
    void addMark(const TickRecord& record) noexcept;
    void judgeMarks(Score& score) const noexcept;
    void addPicture(const TickRecord& record) noexcept;
    void judgeProbe(Score& score) const noexcept;
    void addScan(const TickRecord& record) noexcept;

    double rate_ = 1000;     // [Hz]
    double toolRadius_ = 0;  // [m]
    std::size_t structures_ = 0;
    Score score_;
    PathMeter path_, insidePath_;
    Vec3 hand_{0.0}, tip_{0.0};  // of the last tick [m]
    Vec3 force_{0.0};            // of the tissue on the hand, at the last tick [N]
    std::uint64_t ticks_ = 0, lastTick_ = 0, firstContact_ = 0, lastTouch_ = 0;
    std::uint64_t contactTicks_ = 0, restTicks_ = 0, vitalTicks_ = 0;
    double forceSum_ = 0;                     // [N]
    double depthPeak_ = 0, depthValley_ = 0;  // of the shaft inside [m]
    bool withdrawing_ = false, touched_ = false;
    // Of this way in: least distance to the target, length inside where that was, and the largest.
    double nearest_ = std::numeric_limits<double>::infinity(), atTarget_ = 0, furthest_ = 0;  // [m]
    Vec3 handAtTarget_{0.0};                                                                  // [m]
    // The last shot of this way in: where the device was, and how much deeper than at the target [m].
    std::optional<std::pair<Vec3, double>> shot_;
    JerkMeter jerk_;
    // Ultrasound: sums over the ticks inside, and the depth that the needle has been to in this way in.
    std::uint64_t probeTicks_ = 0, insideTicks_ = 0, tipTicks_ = 0;
    double inBeamSum_ = 0, shareSum_ = 0, minInBeam_ = std::numeric_limits<double>::infinity(), reached_ = 0;
    bool isDrawnBack_ = false;  // by so much that what follows is another way in
    PressedButton picture_{buttonPicture};
    std::array<Vec3, maxMarks> marks_{};  // [m]
    PressedButton mark_{buttonMark}, unmark_{buttonUnmark};
    std::optional<TargetShape> target_;
};

/// Scores a whole record.
Score scoreOf(const Record& record);

}  // namespace palpate::haptics
