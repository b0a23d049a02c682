#include <haptics/tip.h>

#include <haptics/contact_law.h>
#include <haptics/events.h>
#include <haptics/surface_proxy.h>

#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::haptics {

namespace {

// A sharp tip bites: it slips only when dragged flatter than 27 degrees over the skin.
constexpr double tipFriction = 2.0;
constexpr double mouth = 1e-3;  // a path that is open this deep is one to go in by [m]

// Where a tool would be if others had displaced nothing at its tip.
DeviceSample inTissue(DeviceSample tool, Vec3 pushed) noexcept
{
    tool.position -= pushed;
    return tool;
}

struct Tip {
    const SessionModel& model;
    const volume::Tissue::Reader& reader;
    const occupancy::Body& body;
    const DeviceSample& device;
    double dt;
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
        state.lost = {};
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
        const Vec3 front = occupancy::restPoint(body, way.point) + (way.front - way.point);
        take(touching(model.surface, proxyTool(), front));
        state.pushed.look(body, state.place - offset() * state.normal, device.axis, state.others);
        const auto touched = tissueTouched(state.place - offset() * state.normal);
        addEvent(record, {EventKind::contact, 0xFF, touched, glm::distance(way.front, device.position)});
    }

    // Only the tip of a needle does not slip by itself.
    ProxyTool proxyTool() const noexcept
    {
        return {offset(), model.scene.tool.pressedLength(), device.axis, needle() ? tipFriction : 0.0};
    }

    // Under a point of the surface. The first voxel with tissue may begin up to a voxel deeper: the air before it would be
    // pierced without a force, and the skin behind it would never be.
    std::uint8_t tissueTouched(Vec3 surface) const noexcept
    {
        constexpr double under = 0.5e-3;  // [m]
        constexpr int steps = 4;
        const Vec3 voxel = model.tissue->affine().spacing();
        const double deeper = std::max({voxel.x, voxel.y, voxel.z}) / steps;
        auto touched = reader.tissue(surface - under * state.normal);
        for (int i = 1; i <= steps && touched == 0; ++i) {
            touched = reader.tissue(surface - (under + i * deeper) * state.normal);
        }
        return touched;
    }

    void take(const SurfaceProxy& proxy) noexcept
    {
        state.proxy = proxy.front;
        state.place = proxy.place;
        state.normal = proxy.normal;
    }

    Vec3 press() noexcept
    {
        SurfaceProxy proxy{state.proxy, state.normal, state.place};
        const DeviceSample tool = inTissue(device, state.pushed.at(0.0));
        slip(model.surface, proxyTool(), tool.position, proxy);
        take(proxy);
        if (depthUnder(proxy, tool.position) <= 0.0) {
            release();
            return Vec3(0.0);
        }
        const Vec3 away = tool.position - state.proxy;
        const Vec3 under = state.place - offset() * state.normal;
        const auto local = tissueUnder(model, reader, under, -state.normal, model.scene.tool.radius);
        const double way = glm::length(away);
        const double law = needle() ? needleLaw(model, local).force(way) : sphereForce(model, local, way);
        const double force = std::max(law - state.lost.lost(), 0.0);
        const Vec3 push = -force / way * away;
        state.tissue = tissueTouched(under);
        state.lost.hold(law, relaxationOf(model, state.tissue), dt);
        const double along = -glm::dot(push, device.axis);
        if (!needle() || along <= 0.0 || glm::dot(device.axis, state.normal) > -0.2) {
            return push;
        }
        const bool open = opensHere();
        if (open || along >= row(state.tissue).punctureForce) {
            enterNeedle(model, tool, state);
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
    Tip tip{model, reader, body, tool, dt, state, record};
    state.pushed.follow(state.others, dt);
    if (state.phase == Phase::free) {
        tip.seekContact(way);
    }
    Vec3 force(0.0);
    if (state.phase == Phase::contact) {
        force = tip.press();
    } else if (state.phase == Phase::inserted) {
        force = moveNeedle(model, reader, inTissue(tool, state.pushed.at(state.needle.inserted)), dt, state, record);
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
