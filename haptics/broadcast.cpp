#include <haptics/broadcast.h>

#include <haptics/display_image.h>
#include <volume/resample.h>

#include <glm/common.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

namespace palpate::haptics {

namespace {

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

channel::Scenery sceneryOf(const SessionModel& model, const volume::NodeGrid& labels, bool viewersHand)
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
    s.viewersHand = viewersHand ? 1 : 0;
    return s;
}

// Marks where the warning distances of vital structures end. A block whose middle is further from there than its corners
// are from its middle has nothing to mark.
void markShells(const SessionModel& model, const volume::NodeGrid& grid, std::vector<std::uint8_t>& labels)
{
    constexpr int side = 8;
    const double reach = grid.spacing * (0.5 + 0.5 * side * std::sqrt(3.0));
    for (const auto& structure : model.structures) {
        const auto off = [&](Vec3 p) { return std::abs(structure.distance.distance(p) - structure.warnDistance); };
        const auto mark = [&](Index3 n) {
            if (off(grid.position(n)) < 0.5 * grid.spacing) {
                labels[grid.offset(n)] |= channel::shellBit;
            }
        };
        const auto markBlock = [&](Index3 block) {
            const Index3 from = side * block;
            const Index3 to = glm::min(from + (side - 1), grid.size - 1);
            if (off(0.5 * (grid.position(from) + grid.position(to))) < reach) {
                volume::forEachIndex(from, to, mark);
            }
        };
        if (structure.warnDistance > 0.0) {
            volume::forEachIndex(Index3(0), (grid.size - 1) / side, markBlock);
        }
    }
}

std::vector<std::uint8_t> labelsOn(const SessionModel& model, const volume::NodeGrid& grid)
{
    auto labels = model.tissue->tissueOn(grid);
    markShells(model, grid, labels);
    return labels;
}

}  // namespace

channel::Publisher publisherOf(const std::string& session, const SessionModel& model, bool viewersHand)
{
    return publisherOf(session, model, viewersHand, displayGrid(*model.tissue));
}

channel::Publisher publisherOf(const std::string& session, const SessionModel& model, bool viewersHand,
                               const volume::NodeGrid& display)
{
    auto scenery = sceneryOf(model, display, viewersHand);
    std::vector<std::uint16_t> image;
    if (model.tissue->hasImage()) {
        const volume::Tissue& tissue = *model.tissue;
        const std::vector<float> beyond =
            volume::resampledImage({tissue.size(), tissue.affine()}, tissue.companion()->values,
                                   {display.size, {Mat3(display.spacing), display.origin}}, std::nanf(""));
        image = displayImage(display, tissue.imageOn(display), tissue.imageUnit(), scenery, beyond);
    }
    return {session, scenery, labelsOn(model, display), image};
}

void showTick(const TickRecord& r, const ServoTiming& timing, channel::State& state) noexcept
{
    state.tick = r.tick;
    state.time = static_cast<double>(r.tick) * tickSeconds;
    state.tip = triple(r.device.position + r.deflection);
    state.axis = triple(r.device.axis);
    state.bend = triple(r.deflection);
    state.proxy = triple(r.proxy);
    state.basic = triple(r.basic);
    state.additional = triple(r.additional);
    state.total = triple(r.total);
    state.phase = static_cast<channel::Phase>(r.phase);
    state.status = r.faulted ? channel::Status::faulted : channel::Status::running;
    state.tissue = r.tissue;
    state.inserted = r.inserted;
    state.distance = r.distance;
    state.warning = static_cast<channel::Warning>(r.warning);
    state.warned = r.warned != 0xFF ? r.warned : r.nearestVital != 0xFF ? r.nearestVital : 0;
    state.ahead = r.ahead.structure;
    state.aheadTissueDistance = r.ahead.tissueDistance;
    state.aheadTissue = r.ahead.tissue;
    state.aheadSpeed = r.ahead.speed;
    if (r.fired) {
        ++state.cores;
        state.coreTarget = r.core.targetFraction;
        state.coreLength = r.core.targetLength;
    }
    state.missed = timing.missed;
    if (r.tick % p99Period == p99Period - 1) {
        state.tickP99 = timing.work.quantile(0.99);
    }
}

void showShape(const Simulation& simulation, channel::Displaced& out) noexcept
{
    const auto& shape = simulation.shape();
    const auto moved = shape.moved();
    out.count = static_cast<std::uint32_t>(std::min(moved.size(), channel::maxDisplaced));
    for (std::uint32_t i = 0; i < out.count; ++i) {
        const Vec3f u = shape.u()[moved[i]];
        out.nodes[i] = {moved[i], {u.x, u.y, u.z}};
    }
}

Broadcast::Broadcast(const std::string& session, const SessionModel& model, bool viewersHand)
    : publisher_(publisherOf(session, model, viewersHand))
{
    static_assert(channel::maxStructures == maxStructures && channel::maxTissues == maxTissues);
}

void Broadcast::publish(const TickRecord& record, const ServoTiming& timing, const Simulation& simulation) noexcept
{
    showTick(record, timing, state_);
    publisher_.setState(state_);
    if (record.tick % channel::frameTicks == 0) {
        showShape(simulation, publisher_.backBuffer());
        publisher_.backBuffer().tick = record.tick;
        publisher_.publishDisplaced();
    }
}

void Broadcast::finish() noexcept
{
    state_.status = state_.status == channel::Status::faulted ? state_.status : channel::Status::finished;
    publisher_.setState(state_);
}

}  // namespace palpate::haptics
