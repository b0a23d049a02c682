#include <haptics/tip.h>

#include <haptics/events.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::haptics {

namespace {

// A sharp tip bites: it slips only when dragged flatter than 27 degrees over the skin.
constexpr double tipFriction = 2.0;
constexpr double longestSlip = 1e-3;  // of the proxy over the surface in one step [m]
constexpr int slipSteps = 8;
constexpr double sidewaysLimit = 3.0;     // sideways the tissue gives way at this many cutting forces
constexpr double sidewaysDepth = 10e-3;   // inserted length that doubles the sideways stiffness [m]
constexpr double embedding = 10e-3;       // inserted length at which the tip is surrounded [m]
constexpr double shaftStiffness = 200.0;  // of the tissue that sticks to the shaft [N/m]
constexpr int shaftSamples = 16;

// Inside, tissue resists on all sides: a rigid disc in an infinite medium is twice as stiff as a punch on its surface
// (Selvadurai, "The displacement of a rigid disc inclusion embedded in an infinite elastic medium", 1979; nu = 0.5). It
// comes in over `embedding`: sooner, the force would rise while a pierced skin springs back over the needle.
DepthLaw embedded(DepthLaw surface, double inserted) noexcept
{
    const double share = 1.0 + std::clamp(inserted / embedding, 0.0, 1.0);
    return {share * surface.linear, share * surface.quadratic, surface.stiffest};
}

struct Tip {
    const SessionModel& model;
    const volume::Tissue::Reader& reader;
    const occupancy::Body& body;
    const DeviceSample& device;
    TipState& state;
    TickRecord& record;

    bool needle() const noexcept { return model.scene.tool.kind == datasets::ToolKind::needle; }
    // The proxy of a sphere is its centre: it stays one radius off the surface.
    double offset() const noexcept { return needle() ? 0.0 : model.scene.tool.radius; }
    const volume::TissueRow& row(std::uint8_t r) const noexcept { return model.tissue->table().rows[r]; }

    void release() noexcept
    {
        state.phase = Phase::free;
        state.proxy = device.position;
        state.inserted = state.anchor = 0.0;
        addEvent(record, {EventKind::release, 0xFF, 0, 0.0});
    }

    void seekContact(const occupancy::Sweep& way) noexcept
    {
        if (!way.hit) {
            state.proxy = device.position;
            return;
        }
        state.phase = Phase::contact;
        state.proxy = ontoSurface(occupancy::restPoint(body, way.point));
        state.normal = model.surface.normal(state.proxy);
        const auto touched = reader.tissue(state.proxy - (offset() + 0.5e-3) * state.normal);
        addEvent(record, {EventKind::contact, 0xFF, touched, glm::distance(way.point, device.position)});
    }

    Vec3 ontoSurface(Vec3 p) const noexcept
    {
        for (int i = 0; i < 3; ++i) {
            p += (offset() - model.surface.distance(p)) * model.surface.normal(p);
        }
        return p;
    }

    // Lets the proxy slip over the surface until the force is inside the cone of friction. Bounded steps.
    void slip() noexcept
    {
        const double friction = needle() ? tipFriction : 0.0;
        for (int i = 0; i < slipSteps; ++i) {
            const Vec3 away = device.position - state.proxy;
            const double depth = -glm::dot(away, state.normal);
            const Vec3 across = away + depth * state.normal;
            const double excess = glm::length(across) - friction * std::max(depth, 0.0);
            if (excess <= 1e-9) {
                return;
            }
            state.proxy = ontoSurface(state.proxy + std::min(excess, longestSlip) * glm::normalize(across));
            state.normal = model.surface.normal(state.proxy);
        }
    }

    Vec3 press() noexcept
    {
        slip();
        const Vec3 away = device.position - state.proxy;
        const double depth = -glm::dot(away, state.normal);
        if (depth <= 0.0) {
            release();
            return Vec3(0.0);
        }
        const Vec3 under = state.proxy - offset() * state.normal;
        const auto local = tissueUnder(model, reader, under, -state.normal, model.scene.tool.radius);
        const double way = glm::length(away);
        const double force = needle() ? needleLaw(model, local).force(way) : sphereForce(model, local, way);
        const Vec3 push = -force / way * away;
        state.tissue = reader.tissue(under - 0.5e-3 * state.normal);
        const double along = -glm::dot(push, device.axis);
        if (needle() && along >= row(state.tissue).punctureForce && glm::dot(device.axis, state.normal) < -0.2) {
            pierce(along);
        }
        return push;
    }

    void pierce(double force) noexcept
    {
        state.phase = Phase::inserted;
        state.entry = state.proxy;
        state.deepest = state.proxy;
        state.inserted = 0.0;
        state.anchor = glm::dot(device.position - state.entry, device.axis);
        addEvent(record, {EventKind::puncture, 0xFF, state.tissue, force});
    }

    // How far the path is cut ahead of the proxy; a needle that was turned or shifted by over its radius is off that path.
    double openAhead(Vec3 axis) const noexcept
    {
        const Vec3 rest = state.deepest - state.proxy;
        const double along = glm::dot(rest, axis);
        const bool onPath = glm::length(rest - along * axis) <= model.scene.tool.radius;
        return onPath ? std::max(along, 0.0) : 0.0;
    }

    // Follows the needle along its axis: back freely, forward through what is cut already, and on by cutting.
    double cut(const DepthLaw& law) noexcept
    {
        const Vec3 axis = device.axis;
        double ahead = glm::dot(device.position - state.proxy, axis);
        const double free = ahead < 0.0 ? ahead : std::min(openAhead(axis), ahead);
        state.proxy += free * axis;
        ahead -= free;
        const auto passed = reader.tissue(state.proxy);
        if (free != 0.0 && passed != 0) {
            state.tissue = passed;
        }
        for (int i = 0; i < cutSteps && ahead > 0.0; ++i) {
            const double force = law.force(ahead);
            const auto next = reader.tissue(state.proxy + cutStep * axis);
            const bool boundary = next != state.tissue && next != 0;
            const double cutting = row(state.tissue).cuttingForce;
            const double holds = boundary ? std::max(cutting, row(next).punctureForce) : cutting;
            if (force <= holds) {
                break;
            }
            const double step = boundary ? cutStep : std::min(cutStep, ahead - law.depth(holds));
            state.proxy += step * axis;
            ahead -= step;
            if (boundary) {
                state.tissue = next;
                addEvent(record, {EventKind::puncture, 0xFF, next, force});
            }
        }
        if (openAhead(axis) <= 0.0) {
            state.deepest = state.proxy;
        }
        return std::max(ahead, 0.0);
    }

    // Sideways the shaft is held by all the tissue around it.
    Vec3 holdSideways(const DepthLaw& law) noexcept
    {
        const Vec3 away = device.position - state.proxy;
        const Vec3 across = away - glm::dot(away, device.axis) * device.axis;
        const double way = glm::length(across);
        if (way <= 0.0) {
            return Vec3(0.0);
        }
        const double k = std::min(stiffestContact, law.linear * (1.0 + state.inserted / sidewaysDepth));
        const double limit = sidewaysLimit * row(state.tissue).cuttingForce;
        const double force = std::min(k * way, limit);
        if (k * way > limit) {
            state.proxy += (1.0 - limit / (k * way)) * across;
        }
        return -force / way * across;
    }

    // Stick and slip along the shaft: the tissue holds on to it as far as friction reaches, then lets it slide.
    double shaftFriction(double depth) noexcept
    {
        double perMetre = 0.0;
        for (int i = 0; i < shaftSamples; ++i) {
            const double t = (i + 0.5) / shaftSamples;
            perMetre += row(reader.tissue(glm::mix(state.entry, state.proxy, t))).frictionPerMetre / shaftSamples;
        }
        const double limit = perMetre * state.inserted;
        const double stretch = depth - state.anchor;
        const double force = std::clamp(shaftStiffness * stretch, -limit, limit);
        state.anchor = depth - force / shaftStiffness;
        return -force;
    }

    Vec3 insert() noexcept
    {
        const auto local = tissueUnder(model, reader, state.proxy, device.axis, model.scene.tool.radius);
        const auto law = embedded(needleLaw(model, local), state.inserted);
        const double ahead = cut(law);
        const Vec3 sideways = holdSideways(law);
        state.inserted = glm::dot(state.proxy - state.entry, device.axis);
        if (state.inserted < 0.0) {
            release();
            return Vec3(0.0);
        }
        const double friction = shaftFriction(glm::dot(device.position - state.entry, device.axis));
        return (friction - law.force(ahead)) * device.axis + sideways;
    }
};

}  // namespace

Vec3 moveTip(const SessionModel& model, const volume::Tissue::Reader& reader, const occupancy::Body& body,
             const DeviceSample& device, const occupancy::Sweep& way, TipState& state, TickRecord& record) noexcept
{
    Tip tip{model, reader, body, device, state, record};
    if (state.phase == Phase::free) {
        tip.seekContact(way);
    }
    Vec3 force(0.0);
    if (state.phase == Phase::contact) {
        force = tip.press();
    } else if (state.phase == Phase::inserted) {
        force = tip.insert();
    }
    if (state.phase == Phase::free) {
        state.tissue = 0;
    }
    return force;
}

}  // namespace palpate::haptics
