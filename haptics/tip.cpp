#include <haptics/tip.h>

#include <haptics/contact_law.h>
#include <haptics/events.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::haptics {

namespace {

// A sharp tip bites: it slips only when dragged flatter than 27 degrees over the skin.
constexpr double tipFriction = 2.0;
constexpr double longestSlip = 1e-3;  // of the proxy over the surface in one step [m]
constexpr int slipSteps = 8;
constexpr double mouth = 1e-3;  // a path that is open this deep is one to go in by [m]

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
        state.needle = NeedleState{.cuts = state.needle.cuts};
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
        if (!needle() || along <= 0.0 || glm::dot(device.axis, state.normal) > -0.2) {
            return push;
        }
        const bool open = opensHere();
        if (open || along >= row(state.tissue).punctureForce) {
            enterNeedle(model, device, state);
        }
        if (!open && state.phase == Phase::inserted) {
            addEvent(record, {EventKind::puncture, 0xFF, state.tissue, along});
        }
        return push;
    }

    bool opensHere() const noexcept { return openAhead(state.needle.cuts, state.proxy, device.axis) > mouth; }
};

}  // namespace

Vec3 moveTip(const SessionModel& model, const volume::Tissue::Reader& reader, const occupancy::Body& body,
             const DeviceSample& tool, const occupancy::Sweep& way, double dt, TipState& state, TickRecord& record) noexcept
{
    Tip tip{model, reader, body, tool, state, record};
    if (state.phase == Phase::free) {
        tip.seekContact(way);
    }
    Vec3 force(0.0);
    if (state.phase == Phase::contact) {
        force = tip.press();
    } else if (state.phase == Phase::inserted) {
        force = moveNeedle(model, reader, tool, dt, state, record);
        if (state.needle.inserted < 0.0) {
            tip.release();
        }
    }
    if (state.phase == Phase::free) {
        state.tissue = 0;
    }
    return force;
}

}  // namespace palpate::haptics
