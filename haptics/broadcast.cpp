#include <haptics/broadcast.h>

#include <glm/common.hpp>

#include <algorithm>

namespace palpate::haptics {

namespace {

constexpr std::uint64_t framePeriod = 33;  // ticks: about 30 frames/s, as in the thesis
constexpr std::uint64_t p99Period = 1000;  // a quantile walks over all bins: once a second is enough
constexpr std::size_t displayNodes = 160U * 160U * 160U;

channel::Triple triple(Vec3 v) noexcept
{
    return {v.x, v.y, v.z};
}

channel::Grid gridOf(const volume::NodeGrid& g) noexcept
{
    return {{g.size.x, g.size.y, g.size.z}, 0, triple(g.origin), g.spacing};
}

channel::Name nameOf(const std::string& text) noexcept
{
    channel::Name name{};
    std::copy_n(text.begin(), std::min(text.size(), name.size() - 1), name.begin());
    return name;
}

volume::NodeGrid displayGrid(const volume::Tissue& tissue)
{
    const Vec3 voxel = tissue.affine().spacing();
    const double finest = std::min({voxel.x, voxel.y, voxel.z});
    return volume::affordableGrid(tissue.box(), finest, displayNodes);
}

channel::ToolKind shown(datasets::ToolKind kind)
{
    switch (kind) {
        case datasets::ToolKind::needle:
            return channel::ToolKind::needle;
        case datasets::ToolKind::capsule:
            return channel::ToolKind::capsule;
        default:
            return channel::ToolKind::sphere;
    }
}

channel::Scenery sceneryOf(const SessionModel& model, const volume::NodeGrid& labels)
{
    channel::Scenery s;
    s.scene = nameOf(model.scene.name);
    s.labels = gridOf(labels);
    s.lattice = gridOf(model.lattice.grid);
    const auto& rows = model.tissue->table().rows;
    s.tissues = static_cast<std::uint32_t>(rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
        s.tissue[i] = {nameOf(rows[i].name), {rows[i].colour.x, rows[i].colour.y, rows[i].colour.z}, rows[i].opacity};
    }
    s.structures = static_cast<std::uint32_t>(model.structures.size());
    for (std::size_t i = 0; i < model.structures.size(); ++i) {
        s.structure[i] = nameOf(model.structures[i].name);
        s.warnDistance[i] = model.structures[i].warnDistance;
    }
    const auto& tool = model.scene.tool;
    s.tool = shown(tool.kind);
    s.toolRadius = tool.radius;
    s.toolLength = tool.length;
    s.entry = triple(model.approach.entry);
    s.aim = triple(model.approach.aim);
    s.forceCap = model.scene.forceCap;
    return s;
}

channel::Publisher publisherOf(const std::string& session, const SessionModel& model)
{
    const auto grid = displayGrid(*model.tissue);
    return {session, sceneryOf(model, grid), model.tissue->tissueOn(grid)};
}

}  // namespace

Broadcast::Broadcast(const std::string& session, const SessionModel& model) : publisher_(publisherOf(session, model))
{
    static_assert(channel::maxStructures == maxStructures && channel::maxTissues == maxTissues);
}

void Broadcast::publish(const TickRecord& r, const ServoTiming& timing, const Simulation& simulation) noexcept
{
    state_.tick = r.tick;
    state_.time = static_cast<double>(r.tick) * tickSeconds;
    state_.tip = triple(r.device.position + r.deflection);
    state_.axis = triple(r.device.axis);
    state_.proxy = triple(r.proxy);
    state_.basic = triple(r.basic);
    state_.additional = triple(r.additional);
    state_.total = triple(r.total);
    state_.phase = static_cast<channel::Phase>(r.phase);
    state_.status = r.faulted ? channel::Status::faulted : channel::Status::running;
    state_.tissue = r.tissue;
    state_.inserted = r.inserted;
    state_.distance = r.distance;
    state_.warning = static_cast<channel::Warning>(r.warning);
    state_.warned = r.warned != 0xFF ? r.warned : r.nearestVital != 0xFF ? r.nearestVital : 0;
    state_.ahead = r.ahead.structure;
    state_.aheadTissueDistance = r.ahead.tissueDistance;
    state_.aheadTissue = r.ahead.tissue;
    state_.aheadSpeed = r.ahead.speed;
    if (r.fired) {
        ++state_.cores;
        state_.coreTarget = r.core.targetFraction;
        state_.coreLength = r.core.targetLength;
    }
    state_.missed = timing.missed;
    if (r.tick % p99Period == p99Period - 1) {
        state_.tickP99 = timing.work.quantile(0.99);
    }
    publisher_.setState(state_);
    if (r.tick % framePeriod == 0) {
        publishDisplaced(simulation);
    }
}

void Broadcast::publishDisplaced(const Simulation& simulation) noexcept
{
    const auto& shape = simulation.shape();
    const auto moved = shape.moved();
    channel::Displaced& out = publisher_.backBuffer();
    out.tick = state_.tick;
    out.count = static_cast<std::uint32_t>(std::min(moved.size(), channel::maxDisplaced));
    for (std::uint32_t i = 0; i < out.count; ++i) {
        const Vec3f u = shape.u()[moved[i]];
        out.nodes[i] = {moved[i], {u.x, u.y, u.z}};
    }
    publisher_.publishDisplaced();
}

void Broadcast::finish() noexcept
{
    state_.status = state_.status == channel::Status::faulted ? state_.status : channel::Status::finished;
    publisher_.setState(state_);
}

}  // namespace palpate::haptics
