#include <studies/stability/scene.h>

#include <base/mapped.h>
#include <studies/stability/body.h>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <array>
#include <cmath>
#include <functional>
#include <numbers>

namespace palpate::studies {

namespace {

// Bodies and paths are written in mm.
constexpr double ball = 3;          // radius of the tool [mm]
constexpr double thickBall = 6;     // of the tool that presses deep, as a fingertip [mm]
constexpr double thinBall = 0.5;    // of the tool that stabs [mm]
constexpr double minEnergy = 1e-3;  // what a hand does not notice [J]
constexpr Bounded noEnergy{Figure::energyMade, minEnergy};
constexpr Bounded noPull{Figure::pull, 0.0};
constexpr double stepBound = 5.0;    // of the cap per ms
constexpr double rippleBound = 5.0;  // of the force; the least that is felt is 7 to 10 %

// The firm end of the grips of a stylus: damping and stiffness grow together (Hasser and Cutkosky, "System identification
// of the human hand grasping a haptic knob", 2002).
constexpr haptics::Grip firm{0.1, 5.0, 400.0};
// Goes where it wants to, whatever resists.
constexpr haptics::Grip rigid{0.1, 60.0, 2e4};

// A HandLeg in mm.
struct MmLeg {
    Vec3 to{0.0};      // [mm]
    double speed = 0;  // [mm/s]
    double wait = 0;   // [s]
};

// A HandPath in mm.
struct MmPath {
    Vec3 start{0.0};  // [mm]
    std::vector<MmLeg> legs;
};

HandPath handPath(const MmPath& path)
{
    HandPath out{1e-3 * path.start, haptics::settledAfter, {}};
    out.legs = base::mapped<HandLeg>(path.legs, [](const MmLeg& leg) {
        return HandLeg{1e-3 * leg.to, 1e-3 * leg.speed, leg.wait};
    });
    return out;
}

StabilityScene scene(std::string name, std::string kind, std::string meaning, std::shared_ptr<const volume::Tissue> tissue,
                     double radiusMm, const MmPath& hand)
{
    StabilityScene s;
    s.name = std::move(name);
    s.kind = std::move(kind);
    s.meaning = std::move(meaning);
    s.tissue = std::move(tissue);
    s.session.name = s.name;
    s.session.tool.kind = datasets::ToolKind::sphere;
    s.session.tool.radius = radiusMm * 1e-3;
    s.session.dffb.mode = datasets::DffbMode::off;
    s.session.target = "base";
    s.session.entry = Vec3(0.0);
    s.session.aim = Vec3(0, 10e-3, 0);
    s.hand = handPath(hand);
    s.grip = firm;
    s.from = haptics::settledAfter;
    s.to = s.letGo = s.hand.seconds();
    s.held = s.released = noEnergy;
    return s;
}

std::shared_ptr<const volume::Tissue> flatBody(BodyLabel tissue, double thickness)
{
    constexpr double half = 16;
    return smallBody({-half, -8, -half}, {half, thickness + 5, half}, [=](Vec3 p) {
        const bool inside = p.y > 0 && p.y < thickness + 4 && std::abs(p.x) < half - 2 && std::abs(p.z) < half - 2;
        return !inside ? BodyLabel{} : p.y < thickness ? tissue : bodyBase;
    });
}

// A plate of skin, held all around.
std::shared_ptr<const volume::Tissue> plate(double thickness)
{
    return smallBody({-16, -8, -16}, {16, 8, 16}, [=](Vec3 p) {
        const double out = std::max(std::abs(p.x), std::abs(p.z));
        const bool inside = p.y > 0 && p.y < thickness && out < 14;
        return !inside ? BodyLabel{} : out > 11 ? bodyBase : bodySkin;
    });
}

void addPlates(std::vector<StabilityScene>& out)
{
    for (const int thickness : {1, 2, 3}) {
        auto s = scene(fmt::format("plate-{}mm", thickness), "plate",
                       fmt::format("a plate of skin, {} mm thick, pressed until the device can do no more", thickness),
                       plate(thickness), ball, {{0, -4, 0}, {{{0, 45, 0}, 80, 0.25}}});
        s.farFace = thickness * 1e-3;
        s.held = s.released = {Figure::popThrough, 0.0};
        s.letGo = s.hand.end(0) - 0.1;
        s.quick = thickness == 1;
        out.push_back(std::move(s));
    }
    for (const int speed : {1000, 2000, 4000}) {
        auto s = scene(fmt::format("stab-{}mm_s", speed), "stab",
                       fmt::format("a plate of skin, 1 mm thick, stabbed at {} mm/s with a ball of 0.5 mm radius", speed),
                       plate(1), thinBall, {{0, -60, 0}, {{{0, 25, 0}, static_cast<double>(speed), 0.1}}});
        s.grip = rigid;
        s.farFace = 1e-3;
        s.held = s.released = {Figure::popThrough, 0.0};
        s.letGo = haptics::settledAfter + 0.060 / (speed * 1e-3);
        s.quick = speed == 4000;
        out.push_back(std::move(s));
    }
}

// A ridge (outer) or a groove (inner) along z whose flanks meet at `degrees` in the tissue or in the air.
std::shared_ptr<const volume::Tissue> corner(double degrees, bool outer)
{
    const double half = degrees / 2 * std::numbers::pi / 180;
    return smallBody({-24, -24, -8}, {24, 28, 8}, [=](Vec3 p) {
        const double angle = std::atan2(std::abs(p.x), outer ? p.y : -p.y);
        const bool inside = (outer ? angle < half : angle > half) && p.y < 26 && std::abs(p.x) < 22 && p.y > -22;
        return !inside ? BodyLabel{} : p.y < 22 ? bodySkin : bodyBase;
    });
}

StabilityScene cornerScene(int degrees, bool outer)
{
    const double half = degrees / 2.0 * std::numbers::pi / 180;
    constexpr double deep = 5, along = 12;
    // Lines parallel to the flanks, `deep` below where the ball's middle first touches.
    const double below = (deep - ball) / std::sin(half);
    const double down = outer ? 1.0 : -1.0;
    const Vec3 middle(0, below, 0);
    const Vec3 left = middle + along * Vec3(-std::sin(half), down * std::cos(half), 0);
    const Vec3 right(-left.x, left.y, 0);
    const Vec3 start = outer ? left - 8.0 * Vec3(std::cos(half), std::sin(half), 0) : Vec3(0, -20, 0);
    auto s = scene(fmt::format("{}-{}deg", outer ? "outer" : "inner", degrees), outer ? "outer" : "inner",
                   fmt::format("dragged across {} of {} degrees", outer ? "a ridge" : "a groove", degrees),
                   corner(degrees, outer), ball, {start, {{left, 40, 0.05}, {middle, 40, 0}, {right, 40, 0.1}}});
    s.held = {Figure::forceStep, stepBound};
    s.letGo = s.hand.end(1);
    s.released = {Figure::forceStep, stepBound};
    s.quick = degrees == 90;
    return s;
}

// Skin whose surface is tilted by `degrees` against the voxels.
std::shared_ptr<const volume::Tissue> slope(double degrees)
{
    const double angle = degrees * std::numbers::pi / 180;
    const Vec3 inward(std::sin(angle), std::cos(angle), 0);
    // At 45 degrees voxels' middles must not lie on the surface itself, where rounding would decide.
    constexpr double shift = 0.2;  // [mm]
    return smallBody({-44, -44, -8}, {44, 50, 8}, [=](Vec3 p) {
        const double depth = glm::dot(p, inward) - shift;
        const bool inside = depth > 0 && std::abs(p.x) < 42 && p.y < 48;
        return !inside ? BodyLabel{} : depth < 18 && p.y < 46 ? bodySkin : bodyBase;
    });
}

void addSlides(std::vector<StabilityScene>& out)
{
    for (const int degrees : {10, 15, 22, 30, 45}) {
        const auto tissue = slope(degrees);
        const double angle = degrees * std::numbers::pi / 180;
        const Vec3 inward(std::sin(angle), std::cos(angle), 0), along(std::cos(angle), -std::sin(angle), 0);
        for (const int speed : {10, 20, 80}) {
            // Far enough for the hand, which rings a few times as it starts, to come to rest beside its goal.
            const double slid = speed == 80 ? 60 : 26;
            const Vec3 from = -0.5 * slid * along + (4.5 - ball) * inward;
            auto s = scene(fmt::format("slide-{}deg-{}mm_s", degrees, speed), "slide",
                           fmt::format("slid at {} mm/s over a staircase of voxels of {} degrees", speed, degrees), tissue,
                           ball, {from - 8.0 * inward, {{from, 40, 0.1}, {from + slid * along, double(speed), 0}}});
            s.hand.ease = 0.1;
            // While the goal goes at its speed, but for the first third: until then the hand comes to rest beside it.
            const double begins = s.hand.end(0) + s.hand.ease, ends = s.hand.end(1) - s.hand.ease;
            s.from = begins + (ends - begins) / 3;
            s.to = ends;
            s.held = {Figure::ripple, rippleBound};
            s.letGo = s.from;
            s.quick = degrees == 30 && speed == 20;
            out.push_back(std::move(s));
        }
    }
}

void addTissueSteps(std::vector<StabilityScene>& out)
{
    const auto tissue = smallBody({-18, -8, -14}, {18, 22, 14}, [](Vec3 p) {
        const bool inside = p.y > 0 && p.y < 21 && std::abs(p.x) < 16 && std::abs(p.z) < 12;
        return !inside ? BodyLabel{} : p.y > 17 ? bodyBase : p.x < 0 ? bodyFat : bodyTumour;
    });
    const MmPath path{{-9, -8, 0}, {{{-9, 3, 0}, 40, 0.05}, {{9, 3, 0}, 40, 0.4}}};
    auto step = scene("tumour-step", "tumour", "slid from fat onto a tumour that is 13 times as stiff", tissue, ball, path);
    step.held = step.released = {Figure::forceStep, stepBound};
    step.letGo = step.hand.end(1) - 0.3;
    step.quick = true;
    auto cycle = step;
    cycle.name = cycle.session.name = "tumour-cycle";
    cycle.meaning = "slid from fat onto a tumour, and held there";
    // Long enough for the hand to come to rest where tissue and grip are balanced.
    cycle.hand.legs.back().wait = 1.0;
    cycle.held = {Figure::restCycle, 1.0};
    cycle.released = noEnergy;
    cycle.to = cycle.hand.seconds();
    cycle.from = cycle.to - 0.2;
    cycle.letGo = cycle.hand.end(1) - 0.3;
    cycle.quick = false;
    out.push_back(std::move(step));
    out.push_back(std::move(cycle));
}

void addPunctures(std::vector<StabilityScene>& out)
{
    const auto tissue = smallBody({-14, -12, -14}, {14, 44, 14}, [](Vec3 p) {
        const bool inside = p.y > 0 && p.y < 42 && std::abs(p.x) < 12 && std::abs(p.z) < 12;
        return !inside ? BodyLabel{} : p.y < 2 ? bodySkin : p.y < 14 ? bodyFat : p.y < 38 ? bodyGland : bodyBase;
    });
    auto kick = scene("puncture-kick", "puncture", "a needle through skin, fat and gland", tissue, 1.05,
                      {{0, -5, 0}, {{{0, 32, 0}, 40, 0.1}}});
    kick.session.tool = datasets::ToolSpec{};
    kick.pierced = true;
    kick.held = {Figure::kick, 100.0};
    kick.letGo = kick.hand.end(0) - 0.1;
    auto energy = kick;
    energy.name = energy.session.name = "puncture-energy";
    energy.meaning = "a needle through skin, fat and gland, and out again";
    energy.hand.legs.push_back({{0, -10e-3, 0}, 0.08, 0.1});
    energy.to = energy.hand.seconds();
    energy.held = noEnergy;
    energy.quick = true;
    auto after = energy;
    after.name = after.session.name = "puncture-after";
    after.meaning = "a needle through skin, fat and gland, out again and in the air";
    after.held = {Figure::peakForce, 1.0};
    after.from = after.to - 0.05;
    out.push_back(std::move(kick));
    out.push_back(std::move(energy));
    out.push_back(std::move(after));
}

void addLate(std::vector<StabilityScene>& out)
{
    const auto tissue = flatBody(bodySkin, 18);
    MmPath path{{0, -7, 0}, {}};
    for (int i = 0; i < 4; ++i) {
        path.legs.push_back({{0, 3, 0}, 80, 0});
        path.legs.push_back({{0, -2, 0}, 80, 0});
    }
    const auto add = [&](const std::string& name, const std::string& meaning, double every, double last) {
        auto s = scene(name, "late", meaning, tissue, ball, path);
        s.staleEvery = every;
        s.staleFor = last;
        s.letGo = s.hand.end(2);
        out.push_back(std::move(s));
    };
    for (const int ms : {5, 10, 20, 50}) {
        add(fmt::format("late-{}ms", ms),
            fmt::format("pressed and let up while poses stop for {} ms, ten times a second", ms), 0.1, ms * 1e-3);
        out.back().quick = ms == 20;
    }
    add("stall", "pressed and let up, and then no pose comes any more", 10.0, 10.0 - (haptics::settledAfter + 0.25));
}

void addRest(std::vector<StabilityScene>& out)
{
    auto wall =
        scene("wall-rest", "wall", "resting on bone", flatBody(bodyBase, 6), ball, {{0, -7, 0}, {{{0, 2, 0}, 20, 1.0}}});
    wall.held = {Figure::restCycle, 1.0};
    wall.from = wall.to - 0.3;
    wall.letGo = wall.to - 0.3;
    wall.quick = true;
    out.push_back(std::move(wall));

    const auto skin = flatBody(bodySkin, 18);
    auto letGo = scene("let-go", "let-go", "pressed as hard as the device can, and let go", skin, ball,
                       {{0, -6, 0}, {{{0, 34, 0}, 80, 0.5}}});
    letGo.onlyReleased = letGo.quick = true;
    letGo.letGo = letGo.to - 0.35;
    out.push_back(std::move(letGo));

    auto detour =
        scene("detour", "detour", "pressed, dragged aside, lifted, come back over the first place", flatBody(bodyFat, 18),
              ball, {{-4, -6, 0}, {{{-4, 3, 0}, 40, 0}, {{4, 3, 2}, 40, 0}, {{4, -6, 2}, 80, 0}, {{-4, -6, 0}, 80, 0.3}}});
    detour.held = {Figure::residue, 0.1};
    detour.letGo = detour.hand.end(1);
    detour.quick = true;
    out.push_back(std::move(detour));

    auto anchored = scene("anchored", "anchored", "5 mm of fat on bone, pressed far beyond the bone", flatBody(bodyFat, 5),
                          ball, {{0, -6, 0}, {{{0, 20, 0}, 60, 0}, {{8, 20, 8}, 60, 0.1}}});
    anchored.held = anchored.released = {Figure::peakForce, 100.0};
    anchored.letGo = anchored.hand.end(0);
    anchored.quick = true;
    out.push_back(std::move(anchored));
}

// A session once more, for another figure.
StabilityScene again(const StabilityScene& s, const std::string& name, Bounded held, Bounded letGo)
{
    StabilityScene other = s;
    other.name = other.session.name = name;
    other.held = held;
    other.released = letGo;
    other.quick = false;
    return other;
}

// A block of fat, so thick that a ball of 6 mm hardly feels the bone under it.
std::shared_ptr<const volume::Tissue> fatBlock()
{
    constexpr double half = 32, thickness = 40;
    return smallBody({-half - 2, -8, -half - 2}, {half + 2, thickness + 5, half + 2}, [=](Vec3 p) {
        const bool inside = p.y > 0 && p.y < thickness + 4 && std::abs(p.x) < half && std::abs(p.z) < half;
        return !inside ? BodyLabel{} : p.y < thickness ? bodyFat : bodyBase;
    });
}

void addDeep(std::vector<StabilityScene>& out, const std::shared_ptr<const volume::Tissue>& block)
{
    constexpr double deepest = 2 * thickBall;  // of the ball's middle: three radii of its front
    const Vec3 above(0, -thickBall - 2, 0), deep(0, deepest, 0);
    auto press = scene("deep-press", "deep", "fat pressed to three radii of a ball of 6 mm, and held", block, thickBall,
                       {above, {{deep, 60, 0.3}}});
    press.held = press.released = {Figure::forceStep, stepBound};
    press.letGo = press.hand.end(0) - 0.2;
    press.quick = true;
    out.push_back(std::move(press));

    auto retreat = scene("deep-retreat", "deep", "fat pressed to three radii, drawn back, pressed again and drawn back",
                         block, thickBall, {above, {{deep, 60, 0.2}, {above, 60, 0.1}, {deep, 60, 0.1}, {above, 60, 0.1}}});
    retreat.held = retreat.released = noPull;
    retreat.letGo = retreat.hand.end(2) - 0.1;
    retreat.quick = true;
    out.push_back(retreat);
    out.push_back(again(retreat, "deep-energy", noEnergy, noEnergy));

    // The hand's spring gives way by some of the last millimetre.
    const Vec3 aside(7.5, 0, 0), middle(0, 0.5 * thickBall + 1, 0);
    auto drag = scene("deep-drag", "deep", "dragged through fat for 15 mm, one and a half radii deep", block, thickBall,
                      {above - aside, {{middle - aside, 60, 0.1}, {middle + aside, 20, 0.2}, {above + aside, 60, 0.1}}});
    drag.held = drag.released = {Figure::forceStep, stepBound};
    drag.letGo = drag.hand.end(0) + 0.4;
    drag.quick = true;
    out.push_back(std::move(drag));
}

// A fingertip that lies flat on the block's skin, at 30 degrees.
void addCapsule(std::vector<StabilityScene>& out, const std::shared_ptr<const volume::Tissue>& block)
{
    const double angle = 30 * std::numbers::pi / 180;
    constexpr double long30 = 30 - 2 * thickBall;  // between the middles of its ends
    const Vec3 above(0, -thickBall - 2, 0), deep(0, 10 - thickBall, 0);
    auto retreat = scene("capsule-retreat", "capsule", "a finger of 6 mm radius pressed 9 mm into fat, and drawn back",
                         block, thickBall, {above, {{deep, 60, 0.3}, {above, 60, 0.1}}});
    retreat.session.tool.kind = datasets::ToolKind::capsule;
    retreat.session.tool.length = long30 * 1e-3;
    retreat.axis = {0, std::sin(angle), std::cos(angle)};
    retreat.held = retreat.released = noPull;
    retreat.letGo = retreat.hand.end(0) - 0.1;
    retreat.quick = true;
    out.push_back(retreat);
    out.push_back(again(retreat, "capsule-energy", noEnergy, noEnergy));
}

// A plate of fat, held all around, with 3 mm of air between it and bone.
void addThin(std::vector<StabilityScene>& out)
{
    constexpr double thickness = 6, support = 9, half = 24;
    const auto body = smallBody({-half - 2, -8, -half - 2}, {half + 2, support + 5, half + 2}, [=](Vec3 p) {
        const double aside = std::max(std::abs(p.x), std::abs(p.z));
        const bool inside = p.y > 0 && p.y < support + 4 && aside < half;
        return !inside                             ? BodyLabel{}
               : aside > half - 4 || p.y > support ? bodyBase
               : p.y < thickness                   ? bodyFat
                                                   : BodyLabel{};
    });
    const Vec3 above(0, -thickBall - 2, 0), deep(0, 9, 0);
    auto pinch = scene("thin-pinch", "thin", "6 mm of fat, free on both sides, pressed onto bone, and drawn back", body,
                       thickBall, {above, {{deep, 60, 0.3}, {above, 60, 0.1}}});
    pinch.farFace = thickness * 1e-3;
    pinch.held = pinch.released = {Figure::popThrough, 0.0};
    pinch.letGo = pinch.hand.end(0) - 0.1;
    pinch.quick = true;
    out.push_back(pinch);
    out.push_back(again(pinch, "thin-retreat", noPull, noPull));
}

// Adds a drag, and the same body pressed at its end and drawn back.
void addDragAndRetreat(std::vector<StabilityScene>& out, StabilityScene drag, const std::string& retreat)
{
    drag.held = drag.released = {Figure::forceStep, stepBound};
    drag.letGo = drag.hand.end(1) - 0.1;
    drag.quick = true;
    out.push_back(drag);
    out.push_back(again(drag, retreat, noPull, noPull));
}

// Gaps of few voxels: a slit in fat that lies at 25 degrees to the voxels, and a flap of skin, one voxel thick, over fat.
void addGaps(std::vector<StabilityScene>& out)
{
    constexpr double thickness = 20, half = 20, deep = 4.5 - thickBall, up = -thickBall - 2;
    const auto bodyWith = [&](const std::function<bool(Vec3)>& isGap, double skin) {
        return smallBody({-half - 2, -8, -half - 2}, {half + 2, thickness + 5, half + 2}, [=](Vec3 p) {
            const bool inside = p.y > 0 && p.y < thickness + 4 && std::max(std::abs(p.x), std::abs(p.z)) < half;
            return !inside || isGap(p) ? BodyLabel{} : p.y > thickness ? bodyBase : p.y < skin ? bodySkin : bodyFat;
        });
    };
    const double angle = 25 * std::numbers::pi / 180;
    const Vec3 across(std::cos(angle), 0, std::sin(angle)), down(0, deep, 0), above(0, up, 0);
    const auto slit = bodyWith([=](Vec3 p) { return std::abs(glm::dot(p, across)) < 1 && p.y < 14; }, 0);
    addDragAndRetreat(
        out,
        scene("slit-drag", "slit", "dragged across a slit in fat, 2 mm wide, and drawn back", slit, thickBall,
              {above - 12.0 * across,
               {{down - 12.0 * across, 40, 0.1}, {down + 12.0 * across, 20, 0.2}, {above + 12.0 * across, 60, 0.1}}}),
        "slit-retreat");
    constexpr double root = -6;
    const Vec3 along(12, 0, 0);
    const auto flap = bodyWith([=](Vec3 p) { return p.x > root && p.y > 1 && p.y < 4; }, 1);
    addDragAndRetreat(
        out,
        scene("flap-drag", "flap", "dragged from skin on fat onto a flap of it, 1 mm thick, and drawn back", flap,
              thickBall, {above - along, {{down - along, 40, 0.1}, {down + along, 20, 0.2}, {above + along, 60, 0.1}}}),
        "flap-retreat");
}

struct FigureText {
    std::string_view name, unit;
};
constexpr std::array<FigureText, 9> figureTexts{{{"pop-through depth", "mm"},
                                                 {"ripple", "% of the force"},
                                                 {"force step", "% of the cap per ms"},
                                                 {"peak to peak at rest", "encoder steps"},
                                                 {"speed after puncture", "% of the hand's spring"},
                                                 {"energy made", "J"},
                                                 {"residue", "voxels"},
                                                 {"peak force", "% of the cap"},
                                                 {"pull into the body", "% of the cap"}}};

}  // namespace

std::string_view name(Figure figure) noexcept
{
    return figureTexts[static_cast<std::size_t>(figure)].name;
}

std::string_view unit(Figure figure) noexcept
{
    return figureTexts[static_cast<std::size_t>(figure)].unit;
}

Vec3 HandPath::at(double time) const noexcept
{
    Vec3 from = start;
    double left = time - wait;
    for (const HandLeg& leg : legs) {
        const double length = glm::distance(from, leg.to);
        const double takes = duration(length, leg.speed);
        if (left < takes) {
            const double since = std::max(left, 0.0), until = takes - since;
            // Half the square of time over `ease`, then a straight line, and the same backwards.
            const double begun = since < ease ? 0.5 * since * since / ease : since - 0.5 * ease;
            const double way = until < ease ? length - leg.speed * 0.5 * until * until / ease : leg.speed * begun;
            return glm::mix(from, leg.to, length > 0.0 ? way / length : 1.0);
        }
        left -= takes + leg.wait;
        from = leg.to;
        if (left < 0.0) {
            break;
        }
    }
    return from;
}

double HandPath::end(std::size_t leg) const noexcept
{
    Vec3 from = start;
    double time = wait;
    for (std::size_t i = 0; i <= leg && i < legs.size(); ++i) {
        time += duration(glm::distance(from, legs[i].to), legs[i].speed) + legs[i].wait;
        from = legs[i].to;
    }
    return time;
}

std::vector<StabilityScene> stabilityScenes()
{
    std::vector<StabilityScene> out;
    addPlates(out);
    for (const bool outer : {true, false}) {
        for (const int degrees : {30, 60, 90, 120, 150}) {
            out.push_back(cornerScene(degrees, outer));
        }
    }
    addSlides(out);
    addTissueSteps(out);
    addPunctures(out);
    addLate(out);
    addRest(out);
    const auto block = fatBlock();
    addDeep(out, block);
    addCapsule(out, block);
    addThin(out);
    addGaps(out);
    return out;
}

}  // namespace palpate::studies
