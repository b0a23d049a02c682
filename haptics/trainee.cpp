#include <haptics/trainee.h>

#include <base/error.h>
#include <base/mapped.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::haptics {

using datasets::SessionTask;

constexpr std::array<Skill, 3> skills{{
    {"novice", 0.20e-3, 4.5e-3, 4e-3, 12e-3, 6e-3, 0.25, 0.35, 0.35, 0.25, 5, 0.22, 10e-3, 2.5e-3, 1.2e-3},
    {"resident", 0.10e-3, 2.5e-3, 2.5e-3, 14e-3, 9e-3, 0.15, 0.28, 0.70, 0.35, 4, 0.12, 8e-3, 1.2e-3, 0.7e-3},
    {"expert", 0.05e-3, 1.2e-3, 1.5e-3, 16e-3, 15e-3, 0.08, 0.22, 0.95, 0.45, 3, 0.06, 7e-3, 0.5e-3, 0.3e-3},
}};

constexpr double standOff = 3e-3;     // the tip waits so far before the skin [m]
constexpr double inAirSpeed = 40e-3;  // in air [m/s]
constexpr double tolerance = 1e-3;    // of a movement [m]
constexpr double tooShallow = 2e-3;   // the trainee goes on [m]
constexpr double tooDeep = 4e-3;      // and back [m]; less, and the shaft only draws the tissue along
constexpr double shallow = 4e-3;      // drawn back to so little inside before another line is taken [m]
constexpr double safeAhead = 1e-3;    // a vital structure nearer to the fired tip is seen as in danger [m]
constexpr double squeezeTime = 0.05;  // the fire button stays down [s]
constexpr double touchSpeed = 5e-3;   // towards the skin that is not to be pierced; assumed [m/s]
constexpr double timeOnSkin = 3.3;    // a rest of three seconds, counted slowly [s]
constexpr double lookTime = 1.0;      // at a core [s]
constexpr double patience = 10.0;     // with a movement that does not get there [s]
constexpr double learnt = 0.5;        // fraction of an aim's error that stays when the trainee has seen where it went
constexpr int maxRedirects = 4;       // in one pass; then it fires or gives up
constexpr int maxEntries = 8;
constexpr int maxStrokes = 12;  // on one line
constexpr int maxLooks = 4;     // at one picture without the tip; then it goes on blind

const Skill& skillCalled(std::string_view name)
{
    const auto* const found = std::find_if(skills.begin(), skills.end(), [&](const Skill& s) { return s.name == name; });
    base::failIf(found == skills.end(), "trainee '{}': there are {}", name, fmt::join(skillNames(), ", "));
    return *found;
}

std::vector<std::string> skillNames()
{
    return base::mapped<std::string>(skills, &Skill::name);
}

Trainee::Trainee(const SessionModel& model, const Skill& skill, std::uint64_t seed, double distance)
    : model_(model),
      skill_(skill),
      distance_(distance),
      random_(seed ^ 0x7261696E6565U),
      arm_(deviceParameters(model.scene.device), {},
           model.approach.entry - distance * glm::normalize(model.approach.aim - model.approach.entry)),
      tremor_(skill.tremor, random_),
      probe_(model.scene.probe, skill, seed)
{
    goal_ = arm_.position();
    axis_ = glm::normalize(model.approach.aim - model.approach.entry);
    aimError_ = scatter(skill_.aimError);
    plan(1.0);
    begin(Act::approach);
}

Vec3 Trainee::scatter(double deviation) noexcept
{
    const double x = normalOf(random_), y = normalOf(random_), z = normalOf(random_);
    return deviation * Vec3(x, y, z);
}

// Where to go in, on the skin beside the place that was meant, and where to; of the error so far `keep` stays.
void Trainee::plan(double keep) noexcept
{
    if (keep < 1.0) {
        aimError_ = keep * aimError_ + (1.0 - keep) * scatter(skill_.aimError);
    }
    aim_ = model_.approach.aim + aimError_;
}

// Or, where no core is asked for, to stop with the tip at the aim.
double Trainee::depthToFire() const noexcept
{
    return asks(SessionTask::advance) ? glm::distance(aim_, entry_)
                                      : datasets::firingDepth(model_.scene.tool, glm::distance(aim_, entry_));
}

// A movement to `to` while the needle turns to `axis`.
void Trainee::go(Vec3 to, Vec3 axis) noexcept
{
    from_ = arm_.position();
    to_ = to;
    fromAxis_ = axis_;
    toAxis_ = axis;
    const bool inAir = act_ == Act::approach || act_ == Act::retreat;
    const double speed = inAir ? inAirSpeed : act_ == Act::touch ? touchSpeed : skill_.speed;
    duration_ = std::max(glm::distance(from_, to_) / speed, 0.1);
}

// The next stretch of the way in, or back where the last went too deep.
void Trainee::stroke() noexcept
{
    ++strokes_;
    const double left = depthToFire() - inserted_;
    const double wanted = std::clamp(left, -skill_.stroke, skill_.stroke);
    const double way = wanted * (1.0 + skill_.overshoot * normalOf(random_));
    const double along = glm::dot(arm_.position() - entry_, inward());
    go(entry_ + (along + way) * inward(), inward());
}

void Trainee::begin(Act act) noexcept
{
    act_ = act;
    inAct_ = 0.0;
    const Vec3 planned = glm::normalize(model_.approach.aim - model_.approach.entry);
    switch (act) {
        case Act::approach: {
            // On the skin it is placed across the planned line: the eye judges depth by the touch.
            const Vec3 off = scatter(skill_.entryError);
            entry_ = model_.approach.entry + off - glm::dot(off, planned) * planned;
            ++entries_;
            redirects_ = 0;
            strokes_ = 0;
            go(entry_ - standOff * inward(), inward());
            break;
        }
        case Act::touch:
        case Act::pierce:
            go(entry_ + furthestLead * inward(), inward());
            break;
        case Act::advance:
            stroke();
            break;
        case Act::drawBack:
            go(entry_ + shallow * axis_, axis_);
            break;
        case Act::retreat:
            go(entry_ - distance_ * axis_, axis_);
            break;
        case Act::look:
            probe_.look();
            storing_ = model_.scene.ct.given() ? squeezeTime : 0.0;  // a look is a scan
            go(arm_.position(), axis_);
            break;
        case Act::check:
            storePicture();
            go(arm_.position(), axis_);
            break;
        default:
            go(arm_.position(), axis_);
            break;
    }
}

bool Trainee::arrived() const noexcept
{
    const Vec3 way = to_ - from_;
    const double length = glm::length(way);
    return inAct_ >= duration_ &&
           (length <= 0.0 || glm::dot(arm_.position() - from_, way) / length >= length - 0.5 * tolerance);
}

// The goal goes along the movement's line; when tissue holds the tip back at its end, it runs on ahead of it.
void Trainee::followLeg() noexcept
{
    const double fraction = minimumJerk(inAct_ / duration_);
    const Vec3 way = to_ - from_;
    const double length = glm::length(way);
    const double beyond = std::min(std::max(0.0, inAct_ - duration_) * skill_.speed, furthestLead);
    goal_ = from_ + fraction * way + (length > 0.0 && !arrived() ? beyond / length : 0.0) * way;
    axis_ = glm::normalize(glm::mix(fromAxis_, toAxis_, fraction));
}

bool Trainee::dangerAhead() const noexcept
{
    const double reach = model_.scene.tool.throwLength + safeAhead;
    for (std::size_t i = 1; i < model_.structures.size(); ++i) {
        if (ahead_.structure[i] < reach) {
            return true;
        }
    }
    return false;
}

// On its way in the hand knows the mark on the needle at which it is to stop, and brakes for it.
bool Trainee::isDeepEnough() const noexcept
{
    const bool onward = insideSince_ >= 0.0 && glm::dot(to_ - from_, inward()) > 0.0;
    return onward && inserted_ + braking * glm::dot(arm_.velocity(), inward()) >= depthToFire();
}

void Trainee::takeAnotherLine() noexcept
{
    ++redirects_;
    strokes_ = 0;
    plan(learnt);
    begin(inserted_ > shallow + tolerance ? Act::drawBack : Act::advance);
}

// The last look before the gun: does the line ahead meet the target, and nothing else?
void Trainee::afterCheck() noexcept
{
    if (asks(SessionTask::advance)) {
        return begin(Act::retreat);
    }
    const bool wrong = ahead_.structure[0] > model_.scene.tool.throwLength || dangerAhead();
    const bool seen = wrong && random_.between(0.0, 1.0) < skill_.vigilance;
    if (seen && redirects_ < maxRedirects) {
        takeAnotherLine();
    } else if (seen && dangerAhead()) {
        begin(Act::retreat);
    } else {
        begin(Act::fire);
    }
}

void Trainee::afterCore() noexcept
{
    const bool enough =
        !asks(SessionTask::biopsy) || bestCore_ >= skill_.content || fired_ >= skill_.passes || entries_ >= maxEntries;
    if (enough) {
        act_ = Act::done;
    } else {
        plan(learnt);
        begin(Act::approach);
    }
}

void Trainee::advanceAct() noexcept
{
    const bool there = arrived() || inAct_ > duration_ + patience;
    switch (act_) {
        case Act::approach:
            return there ? begin(asks(SessionTask::touch) ? Act::touch : Act::pierce) : void();
        case Act::touch:
            return touchingSince_ >= skill_.reaction ? begin(Act::rest) : there ? begin(Act::retreat) : void();
        case Act::rest:
            return inAct_ >= timeOnSkin || insideSince_ >= skill_.reaction ? begin(Act::retreat) : void();
        case Act::pierce:
            if (insideSince_ >= skill_.reaction || isDeepEnough()) {
                begin(Act::look);
            } else if (there) {
                begin(Act::retreat);
            }
            return;
        case Act::advance:
            if (warnedSince_ >= skill_.reaction && redirects_ < maxRedirects) {
                takeAnotherLine();
            } else if (there || isDeepEnough()) {
                begin(Act::look);
            }
            return;
        case Act::look:
            if (inAct_ >= skill_.reaction + (probe_.holds() ? ProbeHand::lookTime : 0.0)) {
                if (++looks_ < maxLooks && probe_.wantsAnother()) {
                    return begin(Act::look);
                }
                looks_ = 0;
                const double left = depthToFire() - inserted_;
                const bool deep = (left <= tooShallow && left >= -tooDeep) || strokes_ >= maxStrokes;
                begin(deep ? Act::check : Act::advance);
            }
            return;
        case Act::check:
            return inAct_ >= skill_.reaction ? afterCheck() : void();
        case Act::fire:
            if (inAct_ >= 2.0 * squeezeTime + skill_.reaction) {
                storePicture();
                begin(Act::retreat);
            }
            return;
        case Act::drawBack:
            return there ? begin(Act::advance) : void();
        case Act::retreat:
            return there ? begin(Act::judge) : void();
        case Act::judge:
            return inAct_ >= lookTime ? afterCore() : void();
        case Act::done:
            return;
    }
}

// One before and one after the shot belong to the task; where CT guides, a picture is a scan.
void Trainee::storePicture() noexcept
{
    storing_ = model_.scene.ct.given() || probe_.stores() ? squeezeTime : 0.0;
}

DeviceSample Trainee::read() noexcept
{
    inAct_ += tickSeconds;
    if (act_ != Act::done) {
        advanceAct();
        followLeg();
    }
    DeviceSample sample;
    const double now = static_cast<double>(ticks_++) * tickSeconds;
    arm_.pull(goal_ + tremor_.at(now));
    sample.position = arm_.read();
    sample.axis = axis_;
    sample.buttons = buttonDeadMan | (act_ == Act::fire && inAct_ < squeezeTime ? buttonFire : 0U);
    sample.probe = probe_.read();
    sample.buttons |= storing_ > 0.0 ? buttonPicture : 0U;
    storing_ -= tickSeconds;
    return sample;
}

void Trainee::observe(const TickRecord& record) noexcept
{
    const auto since = [](bool now, double before) { return now ? std::max(before, 0.0) + tickSeconds : -1.0; };
    probe_.observe(record);
    inserted_ = record.inserted;
    ahead_ = record.ahead;
    insideSince_ = since(record.phase == Phase::inserted, insideSince_);
    touchingSince_ = since(record.phase == Phase::contact, touchingSince_);
    warnedSince_ = since(record.warning >= WarningLevel::veryNear, warnedSince_);
    if (record.fired) {
        ++fired_;
        bestCore_ = std::max(bestCore_, record.core.targetFraction);
    }
}

}  // namespace palpate::haptics
