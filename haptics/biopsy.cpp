#include <haptics/biopsy.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::haptics {

namespace {

struct Frame {
    Vec3 right, up;
};

Frame frameAcross(Vec3 axis) noexcept
{
    const Vec3 other = std::abs(axis.x) < 0.7 ? Vec3(1, 0, 0) : Vec3(0, 1, 0);
    const Vec3 right = glm::normalize(glm::cross(axis, other));
    return {right, glm::cross(axis, right)};
}

constexpr int throwHalvings = 5;  // of a step that ends in bone
constexpr int mostSteps = 400;    // from the proxy to the tip

// The row of bone at a place at rest; 0: there is none.
std::uint8_t boneAt(const SessionModel& model, const volume::Tissue::Reader& reader, Vec3 rest) noexcept
{
    const std::uint8_t row = reader.tissue(rest);
    return model.tissue->table().rows[row].role == volume::Role::bone ? row : std::uint8_t{0};
}

// The first bone on a straight way at rest; 0: there is none.
std::uint8_t boneBetween(const SessionModel& model, const volume::Tissue::Reader& reader, Vec3 from, Vec3 to) noexcept
{
    const int steps = std::clamp(static_cast<int>(std::ceil(glm::distance(from, to) / throwStep)), 1, mostSteps);
    std::uint8_t bone = 0;
    for (int i = 0; i <= steps && bone == 0; ++i) {
        bone = boneAt(model, reader, glm::mix(from, to, static_cast<double>(i) / steps));
    }
    return bone;
}

// Counts the pieces of a core, slice by slice along its axis.
struct Pieces {
    double slice = 0;  // length [m]
    double modulus = 0;
    double run = 0;  // of the piece so far [m]
    std::uint32_t count = 0;

    void add(double youngsModulus) noexcept
    {
        const bool gap = youngsModulus <= 0.0;
        const bool contrast = !gap && modulus > 0.0 &&
                              std::max(youngsModulus, modulus) >= breakingContrast * std::min(youngsModulus, modulus);
        if (gap || contrast) {
            end();
        }
        run += gap ? 0.0 : slice;
        modulus = youngsModulus;
    }
    void end() noexcept
    {
        count += run >= minPiece ? 1U : 0U;
        run = 0.0;
    }
};

}  // namespace

Throw throwOf(const SessionModel& model, const volume::Tissue::Reader& reader, const occupancy::Body& body, Vec3 proxy,
              Vec3 tip, Vec3 axis) noexcept
{
    std::uint8_t bone = boneBetween(model, reader, proxy, proxy + minPiece * axis);
    bone = bone != 0 ? bone : boneBetween(model, reader, proxy, occupancy::restPoint(body, tip));
    if (bone != 0) {
        return {0.0, bone};
    }
    const double whole = model.scene.tool.throwLength;
    const auto boneAfter = [&](double way) { return boneAt(model, reader, occupancy::restPoint(body, tip + way * axis)); };
    const int steps = static_cast<int>(std::ceil(whole / throwStep));
    for (int i = 1; i <= steps; ++i) {
        double low = (i - 1) * throwStep, high = std::min(i * throwStep, whole);
        bone = boneAfter(high);
        for (int n = 0; n < throwHalvings && bone != 0; ++n) {
            const double middle = 0.5 * (low + high);
            (boneAfter(middle) != 0 ? high : low) = middle;
        }
        if (bone != 0) {
            return {low, bone};
        }
    }
    return {whole, 0};
}

CoreSample takeCore(const SessionModel& model, const volume::Tissue::Reader& reader, const occupancy::Body& body,
                    const Cuts& cuts, Vec3 tip, Vec3 axis, double thrown) noexcept
{
    const auto& tool = model.scene.tool;
    const auto& target = model.structures[0].labels;
    const double way = std::min(thrown, tool.throwLength);
    const double length = way < tool.throwLength ? std::min(tool.notchLength, way) : tool.notchLength;
    CoreSample core;
    core.notchEnd = tip + way * axis;
    core.notchStart = core.notchEnd - length * axis;
    const auto [right, up] = frameAcross(axis);
    const auto inTarget = [&](Vec3 rest) {
        return std::find(target.begin(), target.end(), reader.label(rest)) != target.end();
    };

    int filled = 0;
    int hits = 0;
    int slicesInTarget = 0;
    Pieces pieces{length / coreSlices};
    for (int i = 0; i < coreSlices; ++i) {
        const Vec3 middle = core.notchStart + (i + 0.5) / coreSlices * length * axis;
        // The displacement varies over the lattice's spacing, far more slowly than over the notch's width.
        const Vec3 rest = occupancy::restPoint(body, middle);
        const HolesNear holes(cuts, rest, tool.notchRadius);
        const bool there = !holes.contain(rest);
        slicesInTarget += there && inTarget(rest) ? 1 : 0;
        pieces.add(there ? model.tissue->table().rows[reader.tissue(rest)].youngsModulus : 0.0);
        for (int n = 0; n < coreRings * coreSectors; ++n) {
            const int r = n / coreSectors;
            const double radius = tool.notchRadius * std::sqrt((r + 0.5) / coreRings);  // rings of equal area
            // Each slice is turned by the golden ratio of a sector, so that slices do not repeat each other's error.
            const double sector = n % coreSectors + 0.5 * (r % 2) + i / std::numbers::phi;
            const double turn = 2.0 * std::numbers::pi * sector / coreSectors;
            const Vec3 p = rest + radius * (std::cos(turn) * right + std::sin(turn) * up);
            const auto row = holes.contain(p) ? std::uint8_t{0} : reader.tissue(p);
            if (row != 0) {
                ++filled;
                core.fraction[row] += 1.0;
                hits += inTarget(p) ? 1 : 0;
            }
        }
    }
    pieces.end();
    core.restStart = occupancy::restPoint(body, core.notchStart);
    core.restEnd = occupancy::restPoint(body, core.notchEnd);
    for (double& f : core.fraction) {
        f /= std::max(filled, 1);
    }
    const double notch = std::numbers::pi * tool.notchRadius * tool.notchRadius * length;
    core.volume = notch * filled / coreSamples;
    core.targetFraction = static_cast<double>(hits) / std::max(filled, 1);
    core.targetLength = length * slicesInTarget / coreSlices;
    core.fragments = pieces.count;
    return core;
}

void removeCore(const SessionModel& model, const occupancy::Body& body, const CoreSample& core, Vec3 tip,
                Cuts& cuts) noexcept
{
    const auto& tool = model.scene.tool;
    const auto between = [&](Vec3 from, Vec3 to, double fraction) {
        return occupancy::restPoint(body, glm::mix(from, to, fraction));
    };
    for (int i = 0; i < coreChannels; ++i) {
        const Vec3 from = between(core.notchStart, core.notchEnd, static_cast<double>(i) / coreChannels);
        const Vec3 to = between(core.notchStart, core.notchEnd, (i + 1.0) / coreChannels);
        const double length = glm::distance(from, to);
        if (length > 0.0) {
            cuts.cores.add({from, (to - from) / length, length, tool.notchRadius});
        }
    }
    Vec3 before = between(tip, core.notchEnd, 0.0);
    for (int i = 1; i <= coreChannels; ++i) {
        const Vec3 next = between(tip, core.notchEnd, static_cast<double>(i) / coreChannels);
        cutPath(cuts, before, next, tool.radius);
        before = next;
    }
}

}  // namespace palpate::haptics
