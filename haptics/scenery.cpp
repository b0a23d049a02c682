#include <haptics/scenery.h>

#include <base/utf8.h>
#include <channel/bounds.h>
#include <datasets/tables.h>
#include <haptics/display_image.h>
#include <volume/resample.h>

#include <tbb/parallel_for.h>
#include <glm/common.hpp>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>

namespace palpate::haptics {

namespace {

// The first bytes of a text, of UTF-8 whole characters. Returns how many.
std::size_t beginOf(const std::string& text, std::size_t most, channel::Name& name) noexcept
{
    std::size_t bytes = std::min(text.size(), most);
    while (bytes > 0 && bytes < text.size() && !base::beginsCharacter(text[bytes])) {
        --bytes;
    }
    std::copy_n(text.begin(), bytes, name.begin());
    return bytes;
}

}  // namespace

channel::Name nameOf(const std::string& text) noexcept
{
    channel::Name name{};
    beginOf(text, name.size() - 1, name);
    return name;
}

channel::Name shownNameOf(const std::string& text) noexcept
{
    constexpr std::string_view ellipsis = "\u2026";
    channel::Name name{};
    if (text.size() < name.size()) {
        return nameOf(text);
    }
    const std::size_t bytes = beginOf(text, name.size() - 1 - ellipsis.size(), name);
    std::ranges::copy(ellipsis, name.begin() + static_cast<std::ptrdiff_t>(bytes));
    return name;
}

namespace {

constexpr std::size_t displayNodes = 160U * 160U * 160U;
// Of the labels that the ultrasound picture is made from.
constexpr std::size_t fineNodes = 16'000'000;
constexpr double finestUltrasound = 0.2e-3;  // [m]
constexpr double aroundProcedure = 60e-3;    // to each side of the aim [m]

channel::Grid gridOf(const volume::NodeGrid& g) noexcept
{
    return {{g.size.x, g.size.y, g.size.z}, 0, triple(g.origin), g.spacing};
}

// With voxels of this size no side of the box has more of them than viewers take: a thin body of thin voxels may be long.
double finestAlong(const volume::Box& box)
{
    constexpr int around = 8;  // of the box, at the most
    const Vec3 extent = box.high - box.low;
    return std::max({extent.x, extent.y, extent.z}) / (channel::longestSide - around);
}

// The grid with its nodes where each has a voxel around it, or each voxel as many nodes as the next, along the axes that
// volume and patient share. Between two voxels a node would belong to both, and the first would have it: the whole body
// would be shown half a voxel beside its place. The nodes move by less than one spacing towards the lower end, of two that
// the grid has beyond the box.
volume::NodeGrid onVoxels(volume::NodeGrid grid, const volume::Affine& voxels)
{
    constexpr double same = 1e-6;  // of a spacing
    for (int axis = 0; axis < 3; ++axis) {
        for (const Vec3& step : {voxels.linear[0], voxels.linear[1], voxels.linear[2]}) {
            const double voxel = glm::length(step);
            if (std::abs(std::abs(step[axis]) - voxel) > same * voxel) {
                continue;
            }
            const double larger = std::max(voxel, grid.spacing), smaller = std::min(voxel, grid.spacing);
            const bool isEven = std::lround(larger / smaller) % 2 == 0;
            const double node = voxels.origin[axis] + (isEven ? 0.5 * smaller : 0.0);
            const double off = (grid.origin[axis] - node) / grid.spacing;
            grid.origin[axis] -= grid.spacing * std::max(0.0, off - std::floor(off + same));
        }
    }
    return grid;
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

void addUltrasound(const SessionModel& model, channel::Scenery& s)
{
    const auto& rows = model.tissue->table().rows;
    std::transform(rows.begin(), rows.end(), s.sound.begin(), soundOf);
    const auto& probe = model.scene.probe;
    s.probe = static_cast<channel::ProbeKind>(probe.kind);
    s.probeDepth = probe.depth;
    s.probeFrequency = probe.frequency;
    s.probeFocus = probe.focus;
    s.holeRadius = model.scene.tool.notchRadius;
}

channel::Scenery sceneryOf(const SessionModel& model, const volume::NodeGrid& labels, std::uint32_t viewersHand)
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
    s.task = static_cast<channel::Task>(model.scene.task);
    s.toolRadius = tool.radius;
    s.toolLength = tool.length;
    s.entry = triple(model.approach.entry);
    s.aim = triple(model.approach.aim);
    s.forceCap = model.scene.forceCap;
    s.viewersHand = viewersHand;
    s.throwLength = tool.throwLength;
    addUltrasound(model, s);
    const datasets::CtSpec& ct = model.scene.ct;
    s.ctSlices = static_cast<std::uint32_t>(ct.slices);
    s.ctWidth = ct.width;
    s.ctDoseIndex = ct.doseIndex;
    s.ctDoseLength = ct.doseLength();
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

// The body's own voxels around the procedure, where they are much finer than those of the display.
std::optional<volume::NodeGrid> fineGrid(const SessionModel& model, const volume::NodeGrid& display)
{
    const Vec3 voxel = model.tissue->affine().spacing();
    const double finest = std::max(std::min({voxel.x, voxel.y, voxel.z}), finestUltrasound);
    volume::Box box = model.tissue->box();
    if (model.approach.entry != model.approach.aim) {
        const Vec3 middle = model.approach.aim;
        box = {glm::max(box.low, middle - aroundProcedure), glm::min(box.high, middle + aroundProcedure)};
    }
    const volume::NodeGrid grid =
        onVoxels(volume::affordableGrid(box, std::max(finest, finestAlong(box)), fineNodes), model.tissue->affine());
    constexpr double worth = 0.8;
    return grid.spacing < worth * display.spacing ? std::optional(grid) : std::nullopt;
}

// The tissue of the voxel around each node: what fills most of a node's cell would take ten times as long.
std::vector<std::uint8_t> nearestTissue(const volume::Tissue& tissue, const volume::NodeGrid& grid)
{
    std::vector<std::uint8_t> rows(grid.count());
    tbb::parallel_for(0, grid.size.z, [&](int z) {
        const volume::Tissue::Reader reader(tissue);
        volume::forEachIndex(Index3(0, 0, z), Index3(grid.size.x - 1, grid.size.y - 1, z),
                             [&](Index3 n) { rows[grid.offset(n)] = reader.tissue(grid.position(n)); });
    });
    return rows;
}

}  // namespace

volume::NodeGrid displayGrid(const volume::Tissue& tissue)
{
    const Vec3 voxel = tissue.affine().spacing();
    const double finest = std::min({voxel.x, voxel.y, voxel.z});
    return onVoxels(volume::affordableGrid(tissue.box(), std::max(finest, finestAlong(tissue.box())), displayNodes),
                    tissue.affine());
}

channel::TissueSound soundOf(const volume::TissueRow& row)
{
    const volume::Acoustics a = datasets::acousticsOf(row);
    return {static_cast<float>(a.soundSpeed),       static_cast<float>(row.density), static_cast<float>(a.attenuation),
            static_cast<float>(a.attenuationPower), static_cast<float>(a.echo),      static_cast<float>(a.echoVariation),
            static_cast<std::uint32_t>(a.pattern)};
}

Showing showingOf(const SessionModel& model, std::uint32_t viewersHand, const volume::NodeGrid& display)
{
    Showing s;
    s.scenery = sceneryOf(model, display, viewersHand);
    s.labels = labelsOn(model, display);
    if (model.tissue->hasImage()) {
        const volume::Tissue& tissue = *model.tissue;
        const std::vector<float> beyond =
            volume::resampledImage({tissue.size(), tissue.affine()}, tissue.companion()->values,
                                   {display.size, {Mat3(display.spacing), display.origin}}, std::nanf(""));
        s.image = displayImage(display, tissue.imageOn(display), tissue.imageUnit(), s.scenery, beyond);
    }
    if (const auto fine = fineGrid(model, display)) {
        s.scenery.fine = gridOf(*fine);
        s.fine = nearestTissue(*model.tissue, *fine);
    }
    return s;
}

}  // namespace palpate::haptics
