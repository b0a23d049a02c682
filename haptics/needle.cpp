#include <haptics/needle.h>

#include <haptics/contact_law.h>
#include <haptics/events.h>
#include <haptics/inner_walls.h>
#include <haptics/tip.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace palpate::haptics {

namespace {

constexpr double sidewaysLimit = 3.0;    // sideways the tissue gives way at this many cutting forces
constexpr double sidewaysDepth = 10e-3;  // inserted length that doubles the sideways stiffness [m]
constexpr double embedding = 10e-3;      // inserted length at which the tip is surrounded [m]
constexpr int shaftSamples = 16;
constexpr double minShaftStiffness = 20.0;  // [N/m]
constexpr double speedBand = 30.0;          // the shaft's speed passes a low-pass at this frequency [Hz]
constexpr double steel = 200e9;             // Young's modulus [Pa]
constexpr double airStep = 0.5e-3;          // [m]
constexpr int mostAirSteps = 400;

// Inside, tissue resists on all sides: a rigid disc in an infinite medium is twice as stiff as a punch on its surface
// (Selvadurai, "The displacement of a rigid disc inclusion embedded in an infinite elastic medium", 1979; nu = 0.5). It
// comes in over `embedding`: sooner, the force would rise while a pierced skin springs back over the needle.
DepthLaw embedded(DepthLaw surface, double inserted) noexcept
{
    const double fraction = 1.0 + std::clamp(inserted / embedding, 0.0, 1.0);
    return {fraction * surface.linear, fraction * surface.quadratic, surface.stiffest};
}

// The part of a tissue with inner walls that a place lies in; 0 where it has none.
std::uint64_t lobeOf(const SessionModel& model, std::uint8_t tissue, Vec3 rest) noexcept
{
    const auto& row = model.tissue->table().rows[tissue];
    return hasWalls(model, row) ? lobeAt(rest, row.wallSpacing) : 0;
}

// What holds the whole of a shaft.
struct ShaftHold {
    double sliding = 0;    // friction [N]
    double stiction = 0;   // [N]
    double damping = 0;    // [N s/m]
    double stiffness = 0;  // [N/m]
    volume::Relaxation relaxation;
};

struct Needle {
    const SessionModel& model;
    const volume::Tissue::Reader& reader;
    const DeviceSample& tool;
    double dt;
    TipState& tip;
    NeedleState& state;
    TickRecord& record;

    const volume::TissueRow& row(std::uint8_t r) const noexcept { return model.tissue->table().rows[r]; }

    std::uint8_t tissueLeft(Vec3 rest) const noexcept { return taken(state.cuts, rest) ? 0 : reader.tissue(rest); }

    // The tissue that a tip is in that gets there. Holes are in what is around them; out of the body it is a voxel away, by
    // more than its surface and its voxels may differ.
    std::uint8_t tissueFor(Vec3 rest) const noexcept
    {
        const auto here = reader.tissue(rest);
        if (here != 0) {
            return taken(state.cuts, rest) ? tip.tissue : here;
        }
        const Vec3 voxel = model.tissue->affine().spacing();
        return model.surface.distance(rest) > std::max({voxel.x, voxel.y, voxel.z}) ? 0 : tip.tissue;
    }

    void moveProxy(double way) noexcept
    {
        tip.proxy += way * tool.axis;
        tip.tissue = tissueFor(tip.proxy);
        state.wentThrough = state.wentThrough || tip.tissue == 0;
        state.lobe = way != 0.0 ? lobeOf(model, tip.tissue, tip.proxy) : state.lobe;
    }

    // Follows the tool along its axis: back as far as the tissue does not come along with the shaft, forward through what
    // is open, and on by cutting. Returns how far the tissue ahead is pushed in.
    double cut(const DepthLaw& law) noexcept
    {
        double ahead = glm::dot(tool.position - tip.proxy, tool.axis);
        const double carried = std::min(state.drag(), 0.0);
        if (ahead <= 0.0) {
            moveProxy(std::min(ahead - carried, 0.0));
            return 0.0;
        }
        for (int i = 0; i < cutSteps; ++i) {
            const double open = std::min(openAhead(state.cuts, tip.proxy, tool.axis), ahead);
            moveProxy(open);
            ahead -= open;
            const double step = ahead > 0.0 ? cutOn(law, ahead) : 0.0;
            ahead -= step;
            if (step <= 0.0) {
                break;
            }
        }
        return std::max(ahead, 0.0);
    }

    double cutOn(const DepthLaw& law, double ahead) noexcept
    {
        const double force = law.force(ahead) - state.tipLost.lost();
        const auto next = tissueFor(tip.proxy + cutStep * tool.axis);
        const bool boundary = next != tip.tissue;
        const double cutting = row(tip.tissue).cuttingForce;
        const std::uint64_t lobe = lobeOf(model, boundary ? next : tip.tissue, tip.proxy + cutStep * tool.axis);
        const bool wall = !boundary && lobe != state.lobe;
        const double holds = boundary ? std::max(cutting, next != 0 ? row(next).punctureForce : 0.0)
                             : wall   ? cutting + wallForce(state.lobe, lobe, row(tip.tissue).wallForce)
                                      : cutting;
        if (force <= holds) {
            return 0.0;
        }
        const bool ruptures = boundary || wall;
        const double step = ruptures ? std::min(cutStep, ahead) : std::min(cutStep, ahead - law.depth(holds));
        const Vec3 from = tip.proxy;
        tip.proxy += step * tool.axis;
        const double left = law.force(ahead - step);
        state.tipLost.renew(ruptures ? left : left - holds);
        if (tip.tissue != 0) {
            cutPath(state.cuts, from, tip.proxy, model.scene.tool.radius);
        }
        state.lobe = ruptures ? lobe : state.lobe;
        if (boundary && next != 0) {
            addEvent(record, {EventKind::puncture, 0xFF, next, force});
        }
        tip.tissue = next;
        state.wentThrough = state.wentThrough || next == 0;
        bend(step);
        return step;
    }

    // A path goes on with the curvature of the tissue that is cut now; the whole is taken as one arc.
    void bend(double step) noexcept
    {
        if (model.scene.tool.bevel > 0.0) {
            const double before = std::max(state.inserted, 0.0);
            const double here = bendCurvature(model.scene.tool, row(tip.tissue));
            state.curvature = (state.curvature * before + here * step) / (before + step);
            state.inserted = before + step;
        }
    }

    // Sideways the shaft is held by all the tissue around it. Where more of it holds, it does so from where it is: what is
    // stored never grows by itself. No tip gets into bone that way.
    Vec3 holdSideways(const DepthLaw& law) noexcept
    {
        const double before = state.sideStiffness;
        double k = std::min(stiffestContact, law.linear * (1.0 + std::max(state.inTissue(), 0.0) / sidewaysDepth));
        const Vec3 away = tool.position - tip.proxy;
        Vec3 across = away - glm::dot(away, tool.axis) * tool.axis;
        if (k > before && before > 0.0) {
            if (moveAside((1.0 - before / k) * across)) {
                across *= before / k;
            } else {
                k = before;
            }
        }
        state.sideStiffness = k;
        const double way = glm::length(across);
        if (way <= 0.0) {
            return Vec3(0.0);
        }
        const double limit = sidewaysLimit * row(tip.tissue).cuttingForce;
        const bool givesWay = k * way > limit && moveAside((1.0 - limit / (k * way)) * across);
        const double force = givesWay ? limit : k * way;
        return -force / way * across;
    }

    // Moves the proxy across the needle; false where bone is there.
    bool moveAside(Vec3 way) noexcept
    {
        const auto isBone = [&](Vec3 at) { return row(tissueFor(at)).role == volume::Role::bone; };
        if (isBone(tip.proxy + way) && !isBone(tip.proxy)) {
            return false;
        }
        tip.proxy += way;
        return true;
    }

    // Looked at in steps, which is rare: only where the tip has been out of the body.
    double lengthInAir() const noexcept
    {
        if (!state.wentThrough) {
            return 0.0;
        }
        const int steps = std::clamp(static_cast<int>(std::ceil(state.inserted / airStep)), 1, mostAirSteps);
        int air = 0;
        for (int i = 0; i < steps; ++i) {
            air += reader.tissue(glm::mix(state.entry, tip.proxy, (i + 0.5) / steps)) == 0 ? 1 : 0;
        }
        return state.inserted * air / steps;
    }

    ShaftHold shaftHold() const noexcept
    {
        ShaftHold hold;
        double modulus = 0.0;
        const double piece = std::max(state.inserted, 0.0) / shaftSamples;
        for (int i = 0; i < shaftSamples; ++i) {
            const Vec3 at = glm::mix(state.entry, tip.proxy, (i + 0.5) / shaftSamples);
            if (state.wentThrough && reader.tissue(at) == 0) {
                continue;
            }
            const auto& tissue = row(tissueLeft(at));
            hold.sliding += piece * tissue.frictionPerMetre;
            hold.stiction += piece * std::max(tissue.frictionPerMetre, tissue.stictionPerMetre);
            hold.damping += piece * tissue.frictionDamping;
            const volume::Relaxation relaxation = relaxationOf(model, tissueLeft(at));
            modulus += model.youngsModulus.at(at) * relaxation.instantaneous() / shaftSamples;
            for (std::size_t term = 0; term < relaxation.weights.size(); ++term) {
                hold.relaxation.weights[term] += relaxation.weights[term] / shaftSamples;
            }
        }
        constexpr double nu = 0.49;
        const double length = shaftSamples * piece;
        const double spread = std::max(std::log(2.5 * length * (1.0 - nu) / model.scene.tool.radius), 1.0);
        const double stiffness = 2.0 * std::numbers::pi * modulus / (2.0 * (1.0 + nu)) * length / spread;
        hold.stiffness = std::clamp(stiffness, minShaftStiffness, stiffestContact);
        return hold;
    }

    // @param advance  of the proxy along the needle in this tick [m]
    double shaftFriction(double advance) noexcept
    {
        const double way = glm::dot(tool.position - std::exchange(state.last, tool.position), tool.axis);
        const double blend = 1.0 - 1.0 / (1.0 + 2.0 * std::numbers::pi * speedBand * dt);
        state.speed += blend * (way / dt - state.speed);
        const ShaftHold hold = shaftHold();
        // Tissue that lets go takes its fraction of the force along; tissue that comes to it holds from where it is.
        if (hold.stiffness < state.shaftStiffness) {
            state.shaftForce *= hold.stiffness / state.shaftStiffness;
            state.shaftLost.scale(hold.stiffness / state.shaftStiffness);
        }
        state.shaftStiffness = hold.stiffness;
        // A rupture drives the tissue back along the shaft, however slow the hand is.
        const bool ruptures = advance > std::max(way, 0.0) + stickWindow * dt;
        const bool slow = std::abs(state.speed) < stickWindow;
        if (ruptures) {
            state.sliding = 1;
        } else if (slow || state.speed * state.sliding < 0.0) {
            state.sliding = 0;
        }
        if (state.sliding == 0) {
            state.shaftForce += hold.stiffness * way;
            const double held = state.shaftForce - state.shaftLost.lost();
            if (std::abs(held) > hold.stiction) {
                state.sliding = held > 0.0 ? 1 : -1;
            }
        }
        // Tissue that a rupture drives back loads the shaft no more than it is stretched by that way: where it would, it
        // sticks.
        const double stretched = state.shaftForce + hold.stiffness * advance;
        if (ruptures && hold.sliding > stretched) {
            state.shaftForce = stretched;
            state.sliding = 0;
        }
        if (state.sliding != 0) {
            state.shaftForce = state.sliding * hold.sliding + hold.damping * state.speed;
            state.shaftLost = {};
        }
        const double force = state.shaftForce - state.shaftLost.lost();
        state.shaftLost.hold(state.shaftForce, hold.relaxation, dt);
        return -force;
    }
};

}  // namespace

void enterNeedle(const SessionModel& model, const DeviceSample& tool, TipState& tip) noexcept
{
    NeedleState& needle = tip.needle;
    tip.phase = Phase::inserted;
    needle = NeedleState{.entry = tip.proxy, .tipLost = std::exchange(tip.lost, {}), .cuts = needle.cuts};
    needle.last = tool.position;
    needle.lobe = lobeOf(model, tip.tissue, tip.proxy);
    const Vec3 other = std::abs(tool.axis.x) < 0.7 ? Vec3(1, 0, 0) : Vec3(0, 1, 0);
    const Vec3 right = glm::normalize(glm::cross(tool.axis, other));
    const double turn = model.scene.tool.bevelTurn;
    needle.bendsTo = std::cos(turn) * right + std::sin(turn) * glm::cross(tool.axis, right);
}

Vec3 moveNeedle(const SessionModel& model, const volume::Tissue::Reader& reader, const DeviceSample& tool, double dt,
                TipState& tip, TickRecord& record) noexcept
{
    Needle needle{model, reader, tool, dt, tip, tip.needle, record};
    NeedleState& state = tip.needle;
    const auto local = tissueUnder(model, reader, tip.proxy, tool.axis, model.scene.tool.radius);
    const auto law = embedded(needleLaw(model, local), state.inserted);
    const double before = glm::dot(tip.proxy, tool.axis);
    const double ahead = needle.cut(law);
    const double advance = glm::dot(tip.proxy, tool.axis) - before;
    const Vec3 sideways = needle.holdSideways(law);
    // A needle that turns about its tip keeps its length inside.
    const Vec3 inside = tip.proxy - state.entry;
    const double along = glm::dot(inside, tool.axis);
    state.inserted = along < 0.0 ? along : glm::length(inside);
    if (state.inserted < 0.0) {
        return Vec3(0.0);
    }
    state.through = needle.lengthInAir();
    const double pushed = law.force(ahead);
    const double atTip = std::max(pushed - state.tipLost.lost(), 0.0);
    state.tipLost.hold(pushed, relaxationOf(model, tip.tissue), dt);
    return (needle.shaftFriction(advance) - atTip) * tool.axis + sideways;
}

DeviceSample bentTool(const DeviceSample& device, const NeedleState& needle) noexcept
{
    if (needle.curvature == 0.0) {
        return device;
    }
    DeviceSample tool = device;
    tool.position += 0.5 * needle.curvature * needle.inserted * needle.inserted * needle.bendsTo;
    tool.axis = glm::normalize(device.axis + needle.curvature * needle.inserted * needle.bendsTo);
    return tool;
}

double bendCurvature(const datasets::ToolSpec& tool, const volume::TissueRow& row) noexcept
{
    if (tool.bevel <= 0.0) {
        return 0.0;
    }
    const double push = row.cuttingForce / std::tan(tool.bevel);
    const double bed = std::max(row.youngsModulus, 1.0) / (1.0 - row.poissonRatio * row.poissonRatio);
    const double r2 = tool.radius * tool.radius;
    const double beam = steel * std::numbers::pi / 4.0 * r2 * r2;
    return 2.0 * push / bed * std::pow(bed / (4.0 * beam), 0.75);
}

}  // namespace palpate::haptics
