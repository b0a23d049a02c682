#include <studies/stability/fuzz.h>

#include <datasets/phantom_random.h>
#include <datasets/tables.h>
#include <haptics/stabiliser.h>
#include <haptics/tick.h>
#include <studies/stability/body.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <limits>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

namespace palpate::studies {

namespace {

using datasets::Random;

constexpr double forceRounding = 1e-9;  // of the cap
// Of the stabiliser, in caps [1/s]; beside it, on the way out the force may fall with the motion.
constexpr double slewPerSecond = 50.0;
constexpr std::array<int, 4> rates{500, 1000, 2000, 4000};
// A body of each sort: all others are these again, turned or thicker.
constexpr std::array<const char*, 13> scenes{
    "plate-1mm", "outer-60deg", "inner-60deg",     "slide-30deg-20mm_s", "tumour-step", "puncture-energy", "wall-rest",
    "let-go",    "deep-press",  "capsule-retreat", "thin-pinch",         "slit-drag",   "flap-drag"};
constexpr double minPull = 0.01;      // of the cap
constexpr double fastestHand = 10.0;  // [m/s]
constexpr double flatWithin = 0.95;   // cosine between normals of a face that is flat

struct Session {
    Cell cell;
    int ticks = 0;
    bool quantised = false;  // poses are whole steps of the device's encoder
};

// Bodies and tools that a scene file may have and nobody would: a tool larger than its body, tissue like water or like
// rock, stuck to it or sliding, a spring at the end of its range.
constexpr std::array<const char*, 4> absurd{"absurd-rock", "absurd-water", "absurd-ball", "absurd-rod"};

std::shared_ptr<const volume::Tissue> absurdBody(double side, double youngsModulus, double compress, double stretch)
{
    auto table = datasets::defaultTissues();
    auto& fat = table.rows[*table.find("fat")];
    fat.youngsModulus = youngsModulus;
    fat.compress = compress;
    fat.stretch = stretch;
    fat.punctureForce = 1000.0;
    return smallBody(
        Vec3(-0.5 * side - 4.0), Vec3(0.5 * side + 4.0),
        [side](Vec3 p) {
            const bool inside = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) < 0.5 * side;
            return !inside ? BodyLabel{} : p.y > 0.5 * side - 3.0 ? bodyBase : bodyFat;
        },
        table);
}

StabilityScene absurdScene(const char* name, std::shared_ptr<const volume::Tissue> tissue, double radius)
{
    StabilityScene s;
    s.name = name;
    s.tissue = std::move(tissue);
    s.session.name = name;
    s.session.tool.kind = std::string_view(name) == "absurd-rod" ? datasets::ToolKind::capsule : datasets::ToolKind::sphere;
    s.session.tool.radius = radius;
    s.session.tool.length = 0.1;
    s.session.dffb.mode = datasets::DffbMode::off;
    s.session.model.stiffness = 1e4;
    s.session.target = "base";
    s.session.aim = Vec3(0, 5e-3, 0);
    return s;
}

std::vector<StabilityScene> absurdScenes()
{
    return {absurdScene(absurd[0], absurdBody(16, 2e10, 1.0, 1.0), 3e-3),
            absurdScene(absurd[1], absurdBody(16, 10.0, 0.01, 10.0), 3e-3),
            absurdScene(absurd[2], absurdBody(10, 3e3, 0.5, 2.0), 30e-3),
            absurdScene(absurd[3], absurdBody(10, 1e9, 0.9, 1.1), 20e-3)};
}

Session sessionOf(Random& random)
{
    static constexpr std::array<const char*, 3> levels{"elastic", "chainmail", "spring"};
    const auto devices = haptics::deviceNames();
    const auto pick = [&](std::size_t n) { return static_cast<std::size_t>(random.bits() % n); };
    Session s;
    const bool beyondReason = random.between(0, 1) < 0.3;
    s.cell = {beyondReason ? absurd[pick(absurd.size())] : scenes[pick(scenes.size())], levels[pick(levels.size())],
              devices[pick(devices.size())], true, rates[pick(rates.size())]};
    s.ticks = static_cast<int>(random.between(0.2, 0.5) * s.cell.rate);
    s.quantised = random.between(0, 1) < 0.5;
    return s;
}

// A hand that does what no hand does.
class Hostile {
public:
    Hostile(Random& random, double period, const StabilityScene& scene)
        : random_(random), period_(period), radius_(scene.session.tool.radius), presses_(chance(0.5))
    {
        position_ = Vec3(random_.between(-12, 12), random_.between(-6, 6), random_.between(-6, 6)) * 1e-3;
        sample_.axis = scene.axis;
        sample_.buttons = haptics::buttonDeadMan;
    }

    haptics::DeviceSample next()
    {
        presses_ ? press() : wander();
        if (chance(0.01)) {
            position_ = random_.between(0.0, 0.04) * random_.direction();
        }
        sample_.fresh = true;
        if (stale_ > 0 || chance(0.01)) {
            stale_ = stale_ > 0 ? stale_ - 1 : static_cast<int>(random_.between(1, 60));
            sample_.fresh = false;
            return sample_;
        }
        sample_.position = position_ + (chance(0.2) ? 5e-4 * random_.direction() : Vec3(0.0));
        if (chance(0.02)) {
            sample_.axis = random_.direction();
        }
        flicker(haptics::buttonDeadMan, 0.01, 0.2);
        flicker(haptics::buttonFire, 0.1, 0.02);
        flicker(haptics::modelTooSlow, 1.0, 0.002);
        haptics::DeviceSample given = sample_;
        if (chance(0.0005)) {
            spoil(given);
        }
        return given;
    }

private:
    bool chance(double fraction) { return random_.between(0, 1) < fraction; }

    void wander()
    {
        velocity_ += random_.between(0.0, 2.0) * std::sqrt(period_) * random_.direction();
        velocity_ -= 40.0 * period_ * position_ + 2.0 * period_ * velocity_;
        position_ += period_ * velocity_;
    }

    // To four radii below the face across y, out of it, and aside while deep, at 30 mm/s to 3 m/s.
    void press()
    {
        const double step = speed_ * period_, left = glm::distance(position_, goal_);
        if (step < left) {
            position_ += step / left * (goal_ - position_);
            return;
        }
        position_ = goal_;
        if (chance(0.1)) {
            const bool out = chance(0.3), aside = chance(0.4);
            goal_.y = out ? -random_.between(1.0, 3.0) * radius_ : random_.between(-1.0, 3.0) * radius_;
            goal_.x = aside ? random_.between(-10e-3, 10e-3) : goal_.x;
            goal_.z = aside ? random_.between(-10e-3, 10e-3) : goal_.z;
            speed_ = 0.03 * std::pow(100.0, random_.between(0, 1));
        }
    }

    void flicker(std::uint32_t button, double off, double on)
    {
        const bool down = (sample_.buttons & button) != 0;
        if (chance(down ? off : on)) {
            sample_.buttons ^= button;
        }
    }

    void spoil(haptics::DeviceSample& given)
    {
        constexpr double infinity = std::numeric_limits<double>::infinity();
        const std::array<double, 4> bad{std::numeric_limits<double>::quiet_NaN(), infinity, -infinity, 1e300};
        Vec3& which = chance(0.5) ? given.position : given.axis;
        which[static_cast<int>(random_.bits() % 3)] = bad[random_.bits() % bad.size()];
    }

    Random& random_;
    double period_, radius_;
    bool presses_;
    Vec3 position_{0.0}, velocity_{0.0}, goal_{0.0};
    double speed_ = 0.1;
    haptics::DeviceSample sample_;
    int stale_ = 0;
};

// Whether the face under a blunt tool is flat as far as the tool's radius to all sides; at an edge it is not clear which
// face pushes. `out` is its normal.
bool isFlat(const haptics::SessionModel& model, Vec3 proxy, Vec3 out)
{
    const double radius = model.scene.tool.radius;
    const Vec3 foot = proxy - radius * out;
    const Vec3 along = glm::normalize(glm::cross(out, std::abs(out.x) < 0.7 ? Vec3(1, 0, 0) : Vec3(0, 1, 0)));
    const Vec3 across = glm::cross(out, along);
    const std::array<Vec3, 4> sides{along, -along, across, -across};
    return std::ranges::all_of(
        sides, [&](Vec3 side) { return glm::dot(model.surface.normal(foot + radius * side), out) >= flatWithin; });
}

// Watches whether tissue pulls a ball or a finger into the body, along the normal of the surface at rest under it. Without
// friction a surface pushes. What counts is the force of level `elastic` before the controller, whose damping may well
// hold back a tool on its way out, where what is sent pulls too. A tool that was somewhere else in the tick before has not
// pressed the tissue that it is in, nor has one that came in through another face, which the tissue that it has pushed
// aside there rightly holds: it counts again when it has been free.
class PullWatch {
public:
    explicit PullWatch(const haptics::SessionModel& model, double period) : model_(model), furthest_(fastestHand * period)
    {
        const auto& settings = model.scene.model;
        watches_ = settings.level == datasets::ModelLevel::elastic && settings.elastic.friction <= 0.0 &&
                   model.scene.tool.kind != datasets::ToolKind::needle;
    }

    bool pulls(const haptics::TickRecord& record, Vec3 tissue, double cap)
    {
        const Vec3 tip = record.device.position, back = tip - model_.scene.tool.length * record.device.axis;
        const bool jumped =
            glm::distance(tip, tip_) > furthest_ ||
            (model_.scene.tool.kind == datasets::ToolKind::capsule && glm::distance(back, back_) > furthest_);
        tip_ = tip;
        back_ = back;
        const bool free = record.phase == haptics::Phase::free;
        const Vec3 out = model_.surface.normal(record.proxy);
        const bool sameFace = free || wasFree_ || glm::dot(out, out_) >= flatWithin;
        out_ = out;
        wasFree_ = free;
        pressed_ = !jumped && (free || (pressed_ && sameFace));
        if (!watches_ || !pressed_ || record.phase != haptics::Phase::contact) {
            return false;
        }
        const double least = minPull * cap;
        return -glm::dot(tissue, out) > least && -glm::dot(record.total, out) > least && isFlat(model_, record.proxy, out);
    }

private:
    const haptics::SessionModel& model_;
    double furthest_;
    bool watches_ = false;
    bool pressed_ = false;  // what it is in contact with, it has come to from outside
    bool wasFree_ = false;
    Vec3 tip_{0.0}, back_{0.0}, out_{0.0};  // in the tick before: both ends of the tool, the normal under it
};

FuzzResult runHostile(const StabilityModels& models, std::uint64_t seed)
{
    Random random(seed);
    const Session session = sessionOf(random);
    const auto& scene = models.scene(session.cell.scene);
    const auto& method = models.method(session.cell.method);
    const MethodScene at{models.model(scene, method.level), haptics::deviceParameters(session.cell.device),
                         1.0 / session.cell.rate};
    FuzzResult r;
    r.runs = 1;
    try {
        const RunningMethod running = method.start(at);
        Hostile hand(random, at.period, scene);
        const double cap = capOf(at);
        const double maxStep = slewPerSecond * cap * at.period;
        const double stiffest = haptics::stableLimits({at.device, at.period, cap}).stiffness;
        PullWatch watch(at.model, at.period);
        Vec3 before(0.0), position(0.0);
        for (int i = 0; i < session.ticks; ++i) {
            haptics::DeviceSample sample = hand.next();
            if (session.quantised && at.device.encoder > 0.0) {
                sample.position = at.device.encoder * glm::round(sample.position / at.device.encoder);
            }
            const Vec3 force = running.tick(sample);
            const bool finite = std::isfinite(force.x + force.y + force.z);
            const double size = glm::length(force);
            r.nonFinite += finite ? 0 : 1;
            r.overCap += size > cap * (1.0 + forceRounding) ? 1 : 0;
            // Switched off is switched off at once, and a spring that is let go may fall with the motion.
            const double fall = size < glm::length(before) ? stiffest * glm::distance(sample.position, position) : 0.0;
            r.overSlew += size > 0.0 && glm::distance(force, before) > maxStep + fall + forceRounding * cap ? 1 : 0;
            r.pulled += watch.pulls(*running.record(), running.tissue(), cap) ? 1 : 0;
            before = finite ? force : Vec3(0.0);
            position = sample.position;
            ++r.ticks;
        }
    } catch (const std::exception&) {
        r.crashes = 1;
    }
    if (r.crashes + r.overCap + r.overSlew + r.nonFinite + r.pulled > 0) {
        r.failed.push_back(seed);
    }
    return r;
}

}  // namespace

FuzzResult fuzz(StabilityModels& models, std::uint64_t seed, std::uint64_t runs, int jobs,
                const std::function<void(std::size_t)>& told)
{
    models.add(absurdScenes());
    std::vector<Cell> all;
    std::vector<const char*> names(scenes.begin(), scenes.end());
    names.insert(names.end(), absurd.begin(), absurd.end());
    for (const char* const scene : names) {
        for (const char* const level : {"elastic", "chainmail", "spring"}) {
            all.push_back({scene, level, "premium", true, 1000});
        }
    }
    models.prepare(all);
    std::vector<FuzzResult> results(runs);
    onThreads(
        runs, jobs, [&](std::size_t i) { results[i] = runHostile(models, seed + i); }, told);
    FuzzResult sum;
    for (const FuzzResult& r : results) {
        sum.runs += r.runs;
        sum.ticks += r.ticks;
        sum.crashes += r.crashes;
        sum.overCap += r.overCap;
        sum.overSlew += r.overSlew;
        sum.nonFinite += r.nonFinite;
        sum.pulled += r.pulled;
        if (!r.failed.empty() && sum.failed.size() < 10) {
            sum.failed.push_back(r.failed.front());
        }
    }
    return sum;
}

}  // namespace palpate::studies
