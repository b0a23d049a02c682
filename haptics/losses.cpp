#include <haptics/losses.h>

#include <base/direction.h>
#include <base/said.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

namespace palpate::haptics {

namespace {

using base::said;
using base::tr;

constexpr double worthSaying = 1e-3;  // [m]; shorter ways have no direction
constexpr double worthDepth = 5e-3;   // along the needle [m]: the notch is 20 mm long, and tissue is dragged along
constexpr double blindFrom = 3e-3;    // way without the tip in the picture that costs points [m]
constexpr double minPoints = 0.005;   // less is no loss

double points(double most, double fraction)
{
    return most * (1 - fraction);
}

std::string tissueCalled(const SessionInfo& info, std::uint8_t row)
{
    return row < info.tissues.size() ? base::spokenHere(info.tissues[row]) : tr("bone");
}

std::string timesInWords(std::uint32_t n)
{
    return n == 1 ? tr("once") : said(tr("{} times"), n);
}

}  // namespace

// LPS: x to the patient's left, y to the back, z to the head.
std::string directionInWords(Vec3 way)
{
    if (glm::length(way) < worthSaying) {
        return "";
    }
    std::array<int, 3> order{0, 1, 2};
    std::ranges::sort(order, [&](int a, int b) { return std::abs(way[a]) > std::abs(way[b]); });
    const auto named = [&](int axis) { return tr(base::sideInWords(axis, way[axis] > 0)); };
    std::string words = said(tr("towards {}"), named(order[0]));
    if (std::abs(way[order[1]]) > 0.5 * std::abs(way[order[0]])) {
        words += said(tr(" and {}"), named(order[1]));
    }
    return words;
}

LossWatch::LossWatch(const SessionInfo& info) : rate_(info.rate), scorer_(info), target_(targetShapeOf(info))
{
    at_.fill(-1);
}

void LossWatch::note(Moment moment, bool now, double seconds) noexcept
{
    if (now) {
        at_[moment] = seconds;
    }
}

std::optional<double> LossWatch::at(Moment moment) const noexcept
{
    return at_[moment] < 0 ? std::nullopt : std::optional(at_[moment]);
}

void LossWatch::add(const TickRecord& record) noexcept
{
    scorer_.add(record);
    const Score& now = scorer_.counted();
    const double seconds = static_cast<double>(record.tick) / rate_;
    const auto bestOf = [](const Score& s) {
        return std::tuple(s.bestTargetFraction, s.bestTargetLength, s.targetingError);
    };
    if (record.fired && (bestOf(now) != bestOf(before_) || now.passes == 1)) {
        core_ = record.core;
        stop_ = {};
        at_[shot] = seconds;
    }
    note(secondShot, now.passes == 2 && before_.passes == 1, seconds);
    note(secondContact, now.skinContacts == 2 && before_.skinContacts == 1, seconds);
    note(redirect, now.redirects == 1 && before_.redirects == 0, seconds);
    note(pierced, now.deepest > 0 && before_.deepest <= 0, seconds);
    note(force, now.peakForce > before_.peakForce, seconds);
    note(blind, before_.blindAdvance < blindFrom && now.blindAdvance >= blindFrom, seconds);
    note(beyond, now.beyondTarget > before_.beyondTarget, seconds);
    for (std::uint32_t i = 0; i < std::min<std::uint32_t>(record.eventCount, maxEventsPerTick); ++i) {
        const Event& event = record.events[i];
        if (event.kind == EventKind::vitalTouch && at_[touch] < 0) {
            at_[touch] = seconds;
            touched_ = event.structure;
        }
        if (event.kind == EventKind::throwStopped && at_[shot] == seconds) {
            stop_ = event;
        }
        const bool refused = event.kind == EventKind::fireRefused;
        bone_ = refused && bone_ == 0 ? event.tissue : bone_;
        note(refusal, refused && event.tissue == 0, seconds);
        note(boneRefusal, refused && event.tissue != 0, seconds);
    }
    note(mark, now.marks > before_.marks, seconds);
    before_ = now;
}

// Where the best core lay, from the target at rest: records hold no more, and say the same as the session did.
std::string LossWatch::miss(const Score& s, const SessionInfo& info, const std::string& target) const
{
    std::string words = s.bestTargetFraction > 0 ? said(tr("The best core is {:.0f} % {} over {:.1Lf} mm"),
                                                        100 * s.bestTargetFraction, target, 1e3 * s.bestTargetLength)
                                                 : said(tr("No core hit the {}"), target);
    if (s.bestTargetFraction <= 0 && std::isfinite(s.targetingError)) {
        words += said(tr(": the nearest lay {:.1Lf} mm beside it"), 1e3 * s.targetingError);
    }
    if (stop_.kind == EventKind::throwStopped) {
        words +=
            said(tr("; its throw was stopped by {} after {:.1Lf} mm"), tissueCalled(info, stop_.tissue), 1e3 * stop_.value);
    }
    const Vec3 notch = core_.notchEnd - core_.notchStart;
    if (!target_ || glm::length(notch) < worthSaying) {
        return words;
    }
    const Vec3 axis = glm::normalize(notch);
    const Vec3 away = 0.5 * (core_.notchStart + core_.notchEnd) - target_->middle;
    const double along = glm::dot(away, axis);
    const Vec3 across = away - along * axis;
    std::string where;
    if (glm::length(across) >= worthSaying) {
        where = said(tr("{:.1Lf} mm off its middle {}"), 1e3 * glm::length(across), directionInWords(across));
    }
    if (std::abs(along) >= worthDepth) {
        where += said(tr("{}{:.1Lf} mm {}"), where.empty() ? "" : ", ", 1e3 * std::abs(along),
                      along > 0 ? tr("too deep") : tr("not deep enough"));
    }
    return words + (where.empty() ? "" : said(tr("; it lay {}"), where));
}

Loss LossWatch::ofContacts(const Score& s, double most) const
{
    return {"skin_contacts", points(most, sharesOf(s).contacts),
            said(tr("The skin was touched {}"), timesInWords(s.skinContacts)), at(secondContact)};
}

Loss LossWatch::ofForce(const Score& s, double points) const
{
    return {"peak_force_n", points, said(tr("The force rose to {:.1Lf} N"), s.peakForce), at(force)};
}

Loss LossWatch::ofRedirects(const Score& s, double most) const
{
    return {"redirects", points(most, sharesOf(s).redirects),
            said(tr("The needle was drawn back and pushed on again {}"), timesInWords(s.redirects)), at(redirect)};
}

Loss LossWatch::ofPath(const Score& s, double most) const
{
    return {"inserted_path_mm", points(most, sharesOf(s).economy),
            said(tr("The tip went {:.0f} mm inside the body, {:.0f} mm would have done"), 1e3 * s.insertedPath,
                 2e3 * s.deepest),
            std::nullopt};
}

Loss LossWatch::ofBeyond(const Score& s, double most, const std::string& target) const
{
    return {"beyond_target_mm", points(most, sharesOf(s).stays),
            said(tr("The needle was pushed {:.1Lf} mm deeper than the {}"), 1e3 * s.beyondTarget, target), at(beyond)};
}

Loss LossWatch::ofNoCore(const SessionInfo& info) const
{
    if (at(boneRefusal)) {
        return {"passes", 75,
                said(tr("The gun was fired only with the tip at {}: there is no core"), tissueCalled(info, bone_)),
                at(boneRefusal)};
    }
    return {"passes", 75,
            at(refusal) ? tr("The gun was fired only outside the body: there is no core")
                        : tr("The gun was not fired: there is no core"),
            at(refusal)};
}

std::vector<Loss> LossWatch::ofBiopsy(const Score& s, const SessionInfo& info) const
{
    const std::string target = info.structures.empty() ? tr("target") : base::spokenHere(info.structures[0]);
    if (s.passes == 0) {
        return {ofNoCore(info)};
    }
    const ScoreShares fraction = sharesOf(s);
    const double each = (s.hasProbe ? 25.0 / 6.0 : 5.0) * fraction.hit * fraction.stays;
    std::vector<Loss> all{
        {"best_target_pct", points(50, parts(s).core / 50) + points(25, fraction.hit), miss(s, info, target), at(shot)},
        ofBeyond(s, 25 * fraction.hit, target),
        {"passes", points(each, fraction.passes), said(tr("{} cores were taken; one can do"), s.passes), at(secondShot)},
        ofContacts(s, each),
        ofRedirects(s, each),
        ofPath(s, each),
        ofForce(s, points(each, fraction.gentle))};
    if (s.hasProbe) {
        all.push_back({"blind_advance_mm", points(each, fraction.seen),
                       said(tr("The needle went on {:.0f} mm without its tip in the picture"), 1e3 * s.blindAdvance),
                       at(blind)});
    }
    return all;
}

std::vector<Loss> LossWatch::ofPalpation(const Score& s, const SessionInfo& info) const
{
    if (s.marks == 0) {
        return {{"marks", 75, tr("Nothing was marked"), std::nullopt}};
    }
    const std::string target = info.structures.empty() ? tr("lump") : base::spokenHere(info.structures[0]);
    const ScoreShares fraction = sharesOf(s);
    std::string where = std::isfinite(s.markError)
                            ? said(tr("The marks' middle lies {:.1Lf} mm beside that of the {}"), 1e3 * s.markError, target)
                            : said(tr("What was marked cannot be compared with the {}"), target);
    if (target_) {
        const std::span<const Vec3> marks = scorer_.marks();
        const Vec3 sum = std::accumulate(marks.begin(), marks.end(), Vec3(0.0));
        const Vec3 away = sum / static_cast<double>(s.marks) - target_->middle;
        const std::string direction = directionInWords(away - glm::dot(away, target_->axis) * target_->axis);
        where += direction.empty() ? "" : ", " + direction;
    }
    return {
        {"mark_error_mm", points(30, fraction.place) + (20 * fraction.size + 25 * fraction.gentle) * (1 - fraction.near),
         where, at(mark)},
        {"mark_size_error_mm", points(20, fraction.size),
         said(tr("The size was marked {:.1Lf} mm wrong"), 1e3 * s.markSizeError), at(mark)},
        ofForce(s, points(25, fraction.gentle))};
}

std::vector<Loss> LossWatch::ofRest(const Score& s) const
{
    const ScoreShares fraction = sharesOf(s);
    const double kept = fraction.whole * fraction.rested;
    return {{"deepest_mm", points(75, fraction.whole),
             said(tr("The skin was pierced, {:.1Lf} mm deep; it was only to be touched"), 1e3 * s.deepest), at(pierced)},
            {"rest_s", fraction.whole * points(75, fraction.rested),
             said(tr("The tip rested on the skin for {:.1Lf} s"), s.rest), std::nullopt},
            ofContacts(s, 12.5 * kept),
            ofForce(s, points(12.5 * kept, fraction.light))};
}

std::vector<Loss> LossWatch::ofWay(const Score& s, const SessionInfo& info) const
{
    const std::string target = info.structures.empty() ? tr("target") : base::spokenHere(info.structures[0]);
    const ScoreShares fraction = sharesOf(s);
    const double each = 6.25 * fraction.reached * fraction.stays;
    return {{"tip_to_target_mm", points(75, fraction.reached),
             std::isfinite(s.tipToTarget)
                 ? said(tr("The tip came within {:.1Lf} mm of the {} and not into it"), 1e3 * s.tipToTarget, target)
                 : tr("The needle did not go in"),
             std::nullopt},
            ofBeyond(s, 25 * fraction.reached, target),
            ofContacts(s, each),
            ofRedirects(s, each),
            ofPath(s, each),
            ofForce(s, points(each, fraction.gentle))};
}

std::vector<Loss> LossWatch::ofTask(const Score& s, const SessionInfo& info) const
{
    switch (judgedBy(s)) {
        case Judged::marks:
            return ofPalpation(s, info);
        case Judged::rest:
            return ofRest(s);
        case Judged::way:
            return ofWay(s, info);
        case Judged::nothing:
            return {ofForce(s, points(25, sharesOf(s).gentle))};
        case Judged::core:
            break;
    }
    return ofBiopsy(s, info);
}

std::vector<Loss> LossWatch::losses(const SessionInfo& info) const
{
    const Score s = scorer_.score();
    if (s.skinContacts == 0) {
        return {{"skin_contacts", 100, tr("The tool never touched the body"), std::nullopt}};
    }
    std::vector<Loss> all = ofTask(s, info);
    const std::string structure =
        touched_ < info.structures.size() ? base::spokenHere(info.structures[touched_]) : tr("a vital structure");
    all.push_back({"vital_contacts", points(25, parts(s).vital / 25),
                   s.vitalContacts == 0
                       ? said(tr("The tip was in a vital structure for {:.1Lf} s"), s.vitalSeconds)
                       : said(tr("Vital structures were touched {}, first {}, for {:.1Lf} s and up to {:.1Lf} mm deep"),
                              timesInWords(s.vitalContacts), structure, s.vitalSeconds, 1e3 * s.vitalDepth),
                   at(touch)});
    std::erase_if(all, [](const Loss& loss) { return loss.points < minPoints; });
    std::ranges::stable_sort(all, std::ranges::greater{}, &Loss::points);
    return all;
}

std::string inWords(const Loss& loss)
{
    const double points = std::round(std::max(1.0, loss.points));
    return said(base::trn("-{:.0f} point: {}{}", "-{:.0f} points: {}{}", static_cast<unsigned long>(points)), points,
                loss.words, loss.at ? said(tr(" (at {:.1Lf} s)"), *loss.at) : "");
}

std::vector<Loss> lossesOf(const Record& record)
{
    LossWatch watch(record.info());
    record.each([&](const TickRecord& tick) { watch.add(tick); });
    return watch.losses(record.info());
}

}  // namespace palpate::haptics
