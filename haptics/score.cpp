#include <haptics/score.h>

#include <haptics/monitor.h>

#include <fmt/format.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <charconv>
#include <locale>
#include <numbers>
#include <sstream>
#include <tuple>

namespace palpate::haptics {

namespace {

constexpr double pathStep = 0.2e-3;      // [m]
constexpr double redirectLength = 5e-3;  // [m]
constexpr double jerkBlock = 25e-3;      // means over so long [s]
constexpr double contactPause = 0.1;     // off the body, before a touch counts as another one [s]
constexpr double probeTouches = 0.02;    // force of a probe that lies on the skin [N]
constexpr double wellInside = 10e-3;     // from so deep on the needle can be seen [m]

// 1 at `full` or before it, 0 at `none` or beyond it, straight between them. The two may lie either way round.
double ramp(double value, double full, double none) noexcept
{
    return std::clamp((none - value) / (none - full), 0.0, 1.0);
}

double corePoints(double fraction, double length, double error) noexcept
{
    return 30 * std::min(1.0, fraction / 0.5) + 10 * std::min(1.0, length / 10e-3) + 10 * ramp(error, 0, 10e-3);
}

// 0 where there is none, or none that can be.
double extraNumber(const SessionInfo& info, const char* key)
{
    const std::string text = info.extraOf(key);
    double number = 0;
    std::from_chars(text.data(), text.data() + text.size(), number);
    return std::isfinite(number) ? std::max(number, 0.0) : 0.0;
}

// However well it was done: who missed has no technique to be praised for.
void addCore(const Score& s, const ScoreShares& share, ScoreParts& p) noexcept
{
    if (s.passes == 0) {
        return;
    }
    p.core = corePoints(s.bestTargetFraction, s.bestTargetLength, s.targetingError);
    const double done = share.passes + share.contacts + share.redirects + share.economy + share.gentle;
    p.technique = share.hit * share.stays * (s.hasProbe ? 25.0 / 6.0 * (done + share.seen) : 5.0 * done);
}

}  // namespace

TargetShape shapeOfTarget(const SessionModel& model)
{
    TargetShape shape;
    shape.axis = glm::normalize(model.approach.aim - model.approach.entry);
    const auto& field = model.structures[0].distance;
    std::size_t inside = 0;
    for (std::size_t i = 0; i < field.values.size(); ++i) {
        if (field.values[i] < 0.0F) {
            shape.middle += field.grid.position(field.grid.node(i));
            ++inside;
        }
    }
    shape.middle /= static_cast<double>(std::max<std::size_t>(inside, 1));
    double volume = 0;
    for (const auto& s : model.tissue->structures()) {
        const auto& labels = model.structures[0].labels;
        volume += std::find(labels.begin(), labels.end(), s.value) != labels.end() ? s.volume : 0.0;
    }
    shape.diameter = std::cbrt(6.0 * volume / std::numbers::pi);
    return shape;
}

std::string toText(const TargetShape& s)
{
    return fmt::format("{:.9g} {:.9g} {:.9g} {:.9g} {:.9g} {:.9g} {:.9g}", s.middle.x, s.middle.y, s.middle.z, s.axis.x,
                       s.axis.y, s.axis.z, s.diameter);
}

std::optional<TargetShape> targetShapeOf(const SessionInfo& info)
{
    std::istringstream in(info.extraOf(targetShapeKey));
    in.imbue(std::locale::classic());
    TargetShape s;
    const bool whole = !!(in >> s.middle.x >> s.middle.y >> s.middle.z >> s.axis.x >> s.axis.y >> s.axis.z >> s.diameter);
    return whole ? std::optional(s) : std::nullopt;
}

double toolRadiusOf(const SessionInfo& info)
{
    return 1e-3 * extraNumber(info, toolRadiusKey);
}

double scanDoseOf(const SessionInfo& info)
{
    return extraNumber(info, scanDoseKey);
}

// Weights: the list of measures is of Johnson 2012 and of published simulators; the points and the limits are ours, and
// docs/score.md states them.
ScoreShares sharesOf(const Score& s) noexcept
{
    return {.hit = std::min(1.0, s.bestTargetFraction / 0.1),
            .stays = ramp(s.beyondTarget, 3e-3, 15e-3),
            .passes = ramp(s.passes, 1, 5),
            .contacts = ramp(s.skinContacts, 1, 5),
            .redirects = ramp(s.redirects, 0, 4),
            .economy = s.insertedPath > 0 ? std::min(1.0, 2 * s.deepest / s.insertedPath) : 1,
            .gentle = ramp(s.peakForce, 4, 8.5),
            .seen = ramp(s.blindAdvance, 3e-3, 20e-3),
            .place = ramp(s.markError, 2e-3, 20e-3),
            .near = ramp(s.markError, 10e-3, 20e-3),
            .size = ramp(s.markSizeError, 2e-3, 15e-3),
            .light = ramp(s.peakForce, 2, 4),
            .rested = ramp(s.rest, 3, 0),
            .whole = ramp(s.deepest, 0, 3e-3),
            .reached = ramp(s.tipToTarget, 0, 10e-3)};
}

// A tool that is no needle has palpated where it has marked something. A mark with a needle is no size of a lump.
Judged judgedBy(const Score& s) noexcept
{
    using Task = datasets::SessionTask;
    switch (s.aim.task) {
        case Task::touch:
            return Judged::rest;
        case Task::advance:
            return Judged::way;
        case Task::find:
            return Judged::marks;
        case Task::biopsy:
            break;
    }
    const bool needle = s.aim.tool == datasets::ToolKind::needle;
    return needle ? Judged::core : s.marks > 0 ? Judged::marks : Judged::nothing;
}

ScoreParts parts(const Score& s) noexcept
{
    ScoreParts p;
    const ScoreShares share = sharesOf(s);
    if (s.skinContacts == 0) {
        return p;
    }
    p.vital = 25 * std::max(0.0, 1 - 0.4 * s.vitalContacts - 0.1 * s.vitalSeconds - 0.1 * s.vitalDepth * 1e3);
    switch (judgedBy(s)) {
        case Judged::core:
            addCore(s, share, p);
            break;
        case Judged::marks:
            // Who marked another place has neither sized the target nor found it gently.
            p.core = 30 * share.place + 20 * share.near * share.size;
            p.technique = 25 * share.near * share.gentle;
            break;
        case Judged::rest:
            p.core = 50 * share.whole * share.rested;
            p.technique = share.whole * share.rested * 12.5 * (share.contacts + share.light);
            break;
        case Judged::way:
            p.core = 50 * share.reached;
            p.technique =
                share.reached * share.stays * 6.25 * (share.contacts + share.redirects + share.economy + share.gentle);
            break;
        case Judged::nothing:
            p.core = 50;
            p.technique = 25 * share.gentle;
            break;
    }
    return p;
}

void JerkMeter::add(Vec3 tip, double rate) noexcept
{
    const int block = std::max(1, static_cast<int>(std::lround(jerkBlock * rate)));
    sum += tip;
    if (++ticks < block) {
        return;
    }
    std::shift_left(means.begin(), means.end(), 1);
    means.back() = sum / static_cast<double>(ticks);
    sum = Vec3(0.0);
    ticks = 0;
    blocks = std::min(blocks + 1, 4);
    if (blocks == 4) {
        const double dt = block / rate;
        const Vec3 jerk = (means[3] - 3.0 * means[2] + 3.0 * means[1] - means[0]) / (dt * dt * dt);
        squares += glm::dot(jerk, jerk);
        ++count;
    }
}

void JerkMeter::pause() noexcept
{
    sum = Vec3(0.0);
    ticks = 0;
    blocks = 0;
}

void PathMeter::add(Vec3 tip) noexcept
{
    if (!running) {
        running = true;
        anchor = tip;
    }
    const double step = glm::distance(anchor, tip);
    if (step >= pathStep) {
        counted += step;
        anchor = tip;
    }
}

void PathMeter::pause(Vec3 tip) noexcept
{
    counted = length(tip);
    running = false;
}

Scorer::Scorer(const SessionInfo& info)
    : rate_(info.rate),
      toolRadius_(toolRadiusOf(info)),
      structures_(std::min<std::size_t>(info.structures.size(), maxStructures)),
      target_(targetShapeOf(info))
{
    score_.aim = datasets::aimOf(info.sceneText);
    score_.hasProbe = info.probe;
    score_.scanDose = scanDoseOf(info);
}

void Scorer::add(const TickRecord& record) noexcept
{
    const Vec3 hand = record.device.position;
    const Vec3 tip = hand + record.deflection;
    path_.add(tip);
    if (record.phase == Phase::free) {
        jerk_.pause();
    } else {
        jerk_.add(hand, rate_);
    }
    addWork(record);
    ++ticks_;
    addMark(record);
    score_.peakForce = std::max(score_.peakForce, glm::length(record.total));
    addContact(record);
    addTip(record);
    addDepth(record);
    addVital(record);
    if (record.fired) {
        addFiring(record);
    }
    if (score_.hasProbe) {
        addPicture(record);
    }
    if (score_.scanDose > 0) {
        addScan(record);
    }
    hand_ = hand;
    tip_ = tip;
    lastTick_ = record.tick;
}

void Scorer::addContact(const TickRecord& record) noexcept
{
    if (record.phase == Phase::free) {
        return;
    }
    const double pause = static_cast<double>(record.tick - lastTouch_) / rate_;
    if (!touched_) {
        firstContact_ = record.tick;
    }
    if (!touched_ || pause > contactPause) {
        ++score_.skinContacts;
    }
    touched_ = true;
    lastTouch_ = record.tick;
    ++contactTicks_;
    forceSum_ += glm::length(record.total);
}

void Scorer::addTip(const TickRecord& record) noexcept
{
    restTicks_ += record.phase == Phase::contact ? 1 : 0;
    if (record.phase == Phase::inserted) {
        score_.tipToTarget = std::min(score_.tipToTarget, std::max(0.0, record.distance[0]));
    }
}

void Scorer::addDepth(const TickRecord& record) noexcept
{
    const double depth = record.inserted;
    if (record.phase != Phase::inserted) {
        if (insidePath_.running) {
            insidePath_.pause(tip_);
        }
        depthPeak_ = 0;
        withdrawing_ = false;
        nearest_ = std::numeric_limits<double>::infinity();
        furthest_ = 0;
        shot_.reset();
        return;
    }
    addBeyond(record);
    insidePath_.add(record.tip());
    score_.deepest = std::max(score_.deepest, depth);
    if (!withdrawing_) {
        depthPeak_ = std::max(depthPeak_, depth);
        withdrawing_ = depth < depthPeak_ - redirectLength;
        depthValley_ = depth;
    } else {
        depthValley_ = std::min(depthValley_, depth);
        if (depth > depthValley_ + redirectLength) {
            ++score_.redirects;
            withdrawing_ = false;
            depthPeak_ = depth;
        }
    }
}

// In lengths inside and not in places: the tissue goes along with the needle. A withdrawal begins another way in. The gun's
// throw does not count, the device stays where it is.
void Scorer::addBeyond(const TickRecord& record) noexcept
{
    if (record.inserted < furthest_ - redirectLength) {
        nearest_ = std::numeric_limits<double>::infinity();
        furthest_ = record.inserted;
        shot_.reset();
    }
    furthest_ = std::max(furthest_, record.inserted);
    const double distance = std::max(0.0, record.distance[0]);
    // What the needle's line still meets is not behind its tip, however the tissue goes back and forth.
    if (distance <= nearest_ || std::isfinite(record.ahead.structure[0])) {
        nearest_ = std::min(nearest_, distance);
        atTarget_ = record.inserted;
        handAtTarget_ = record.device.position;
    }
    // What the gun took of it lay ahead of the tip, and does no more.
    if (record.fired && record.core.targetLength > 0.0) {
        nearest_ = 0.0;
        atTarget_ = record.inserted + record.core.targetLength;
    }
    // No tip is farther beyond the target than from it, nor than the hand went: skin that gives way springs back over the
    // shaft.
    const double pushed = glm::distance(record.device.position, handAtTarget_);
    double beyond = std::min({record.inserted - atTarget_, distance, pushed});
    // The tissue lets go of the shaft, which slides on while the hand stands.
    if (shot_) {
        beyond = std::min(beyond, std::max(0.0, shot_->second) + glm::distance(record.device.position, shot_->first));
    }
    if (record.fired) {
        shot_.emplace(record.device.position, beyond);
    }
    score_.beyondTarget = std::max(score_.beyondTarget, beyond);
}

void Scorer::addVital(const TickRecord& record) noexcept
{
    const auto count = std::min<std::size_t>(record.eventCount, maxEventsPerTick);
    for (std::size_t i = 0; i < count; ++i) {
        const Event& event = record.events[i];
        score_.warnings += event.kind == EventKind::warning ? 1 : 0;
        if (event.kind == EventKind::vitalTouch) {
            ++score_.vitalContacts;
            score_.vitalDepth = std::max(score_.vitalDepth, event.value);
            score_.vitalMargin = std::min(score_.vitalMargin, -event.value);
        }
    }
    bool inside = false;
    const double reach = touchReach(record.phase, toolRadius_);
    for (std::size_t i = 1; i < structures_; ++i) {
        const double clear = record.distance[i] - reach;
        inside = inside || clear < 0;
        score_.vitalDepth = std::max(score_.vitalDepth, -clear);
        if (record.phase == Phase::inserted) {
            score_.vitalMargin = std::min(score_.vitalMargin, clear);
        }
    }
    vitalTicks_ += inside ? 1 : 0;
}

void Scorer::addFiring(const TickRecord& record) noexcept
{
    double error = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < std::min<std::size_t>(record.eventCount, maxEventsPerTick); ++i) {
        if (record.events[i].kind == EventKind::fire) {
            error = std::max(0.0, record.events[i].value);
        }
    }
    const double fraction = record.core.targetFraction, length = record.core.targetLength;
    const auto worth = [](double f, double l, double e) { return std::tuple(corePoints(f, l, e), f, -e); };
    const bool better =
        score_.passes == 0 ||
        worth(fraction, length, error) > worth(score_.bestTargetFraction, score_.bestTargetLength, score_.targetingError);
    ++score_.passes;
    if (better) {
        score_.targetingError = error;
        score_.bestTargetFraction = fraction;
        score_.bestTargetLength = length;
    }
}

// The force on the hand is what the tissue pushes back with; over a step it is the mean of both ends. That of one end would
// count a part of every movement, and so of a tremor, as work.
void Scorer::addWork(const TickRecord& record) noexcept
{
    const Vec3 force = record.phase == Phase::free ? Vec3(0.0) : record.basic;
    score_.tissueWork -= ticks_ > 0 ? 0.5 * glm::dot(force_ + force, record.device.position - hand_) : 0.0;
    force_ = force;
}

void Scorer::addMark(const TickRecord& record) noexcept
{
    if (mark_.with(record.device) && score_.marks < marks_.size()) {
        marks_[score_.marks++] = record.device.position;
    }
    if (unmark_.with(record.device) && score_.marks > 0) {
        --score_.marks;
    }
}

void Scorer::addPicture(const TickRecord& record) noexcept
{
    probeTicks_ += glm::length(record.probeForce) > probeTouches ? 1 : 0;
    if (picture_.with(record.device)) {
        score_.picturesAfter += score_.passes > 0 ? 1 : 0;
        score_.picturesBefore += score_.passes == 0 && record.phase == Phase::inserted ? 1 : 0;
    }
    if (record.phase != Phase::inserted) {
        reached_ = 0;
        isDrawnBack_ = false;
        return;
    }
    ++insideTicks_;
    tipTicks_ += record.tipInBeam ? 1 : 0;
    inBeamSum_ += record.needleInBeam;
    shareSum_ += record.inserted > 0 ? record.needleInBeam / record.inserted : 0.0;
    const double further = record.inserted - reached_;
    if (further > 0) {
        score_.blindAdvance += record.tipInBeam ? 0.0 : further;
        minInBeam_ = record.inserted > wellInside ? std::min(minInBeam_, record.needleInBeam) : minInBeam_;
        reached_ = record.inserted;
        isDrawnBack_ = false;
    } else if (isDrawnBack_ || record.inserted < reached_ - redirectLength) {
        reached_ = record.inserted;  // what follows is another way in
        isDrawnBack_ = true;
    }
}

void Scorer::addScan(const TickRecord& record) noexcept
{
    score_.scans += picture_.with(record.device) ? 1 : 0;
}

void Scorer::judgeProbe(Score& s) const noexcept
{
    s.probeSeconds = static_cast<double>(probeTicks_) / rate_;
    if (insideTicks_ > 0) {
        const auto n = static_cast<double>(insideTicks_);
        s.needleInBeam = inBeamSum_ / n;
        s.needleShare = shareSum_ / n;
        s.tipShare = static_cast<double>(tipTicks_) / n;
    }
    s.minInBeam = std::isfinite(minInBeam_) ? minInBeam_ : 0.0;
}

void Scorer::judgeMarks(Score& s) const noexcept
{
    if (s.marks == 0 || !target_) {
        return;
    }
    const auto across = [&](Vec3 v) { return v - glm::dot(v, target_->axis) * target_->axis; };
    Vec3 middle(0.0);
    double widest = 0;
    for (std::size_t i = 0; i < s.marks; ++i) {
        middle += marks_[i] / static_cast<double>(s.marks);
        for (std::size_t k = 0; k < i; ++k) {
            widest = std::max(widest, glm::length(across(marks_[i] - marks_[k])));
        }
    }
    s.markError = glm::length(across(middle - target_->middle));
    s.markSizeError = std::abs(widest - target_->diameter);
}

Score Scorer::score() const noexcept
{
    Score s = score_;
    s.seconds = touched_ ? static_cast<double>(lastTick_ - firstContact_) / rate_ : 0;
    s.rest = static_cast<double>(restTicks_) / rate_;
    s.pathLength = path_.length(tip_);
    s.insertedPath = insidePath_.length(tip_);
    s.meanForce = contactTicks_ > 0 ? forceSum_ / static_cast<double>(contactTicks_) : 0;
    s.jerk = jerk_.rms();
    judgeMarks(s);
    judgeProbe(s);
    s.vitalSeconds = static_cast<double>(vitalTicks_) / rate_;
    const ScoreParts p = parts(s);
    s.total = p.core + p.vital + p.technique;
    return s;
}

Score scoreOf(const Record& record)
{
    Scorer scorer(record.info());
    record.each([&](const TickRecord& tick) { scorer.add(tick); });
    return scorer.score();
}

}  // namespace palpate::haptics
