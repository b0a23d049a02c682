#include <studies/thesis/tasks_scene.h>

#include <base/error.h>
#include <base/mapped.h>
#include <datasets/phantom_random.h>
#include <datasets/tables.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace palpate::studies {

namespace {

enum Label : std::uint16_t { airLabel, fatLabel, boneLabel, ballLabel };

constexpr int fewestVoxels = 64;       // along a side: 1 mm
constexpr double radiusShare = 0.3;    // of the distance from one ball to the next
constexpr int airVoxels = 2;           // around the block
constexpr double aimDepth = 40e-3;     // [m]
constexpr double warnDistance = 5e-3;  // [m]

// Cells along a side of the smallest cube of cells that has one for each ball.
int cellsFor(std::size_t inclusions) noexcept
{
    int cells = std::max(1, static_cast<int>(std::cbrt(static_cast<double>(inclusions))));
    const auto enough = [&](int c) {
        return static_cast<std::size_t>(c) * static_cast<std::size_t>(c) * static_cast<std::size_t>(c) >= inclusions;
    };
    while (!enough(cells)) {
        ++cells;
    }
    return cells;
}

// So many different numbers below `all`, by the first steps of a shuffle (Fisher and Yates).
std::vector<std::uint32_t> choose(std::size_t count, std::size_t all, datasets::Random& random)
{
    std::vector<std::uint32_t> numbers(all);
    std::iota(numbers.begin(), numbers.end(), 0U);
    for (std::size_t i = 0; i < count; ++i) {
        const std::size_t other = i + random.bits() % (all - i);
        std::swap(numbers[i], numbers[other]);
    }
    numbers.resize(count);
    return numbers;
}

// A ball in voxels of the block, without the air around it.
struct Ball {
    Index3 centre{0};
    double radius = 0;
};

// Voxels along the block's width, checked.
int sideOf(const InclusionSpec& spec)
{
    const int least = minPitch * cellsFor(spec.inclusions);
    const int side = spec.voxelsPerSide > 0 ? spec.voxelsPerSide : voxelsFor(spec.inclusions);
    base::failIf(spec.inclusions == 0 || side < least,
                 "{} inclusions in a block of {} voxels a side: needs 1 or more, and {} voxels", spec.inclusions, side,
                 least);
    return side;
}

// A ball somewhere in each of so many cells, with a voxel left free between cells.
std::vector<Ball> ballsOf(const InclusionSpec& spec)
{
    const int cells = cellsFor(spec.inclusions);
    const int pitch = sideOf(spec) / cells;
    const double radius = radiusShare * pitch;
    const int reach = static_cast<int>(radius);
    const auto room = static_cast<std::uint64_t>(pitch - 1 - 2 * reach);
    const auto perSide = static_cast<std::uint32_t>(cells);
    datasets::Random random(spec.seed);
    std::vector<Ball> out;
    out.reserve(spec.inclusions);
    for (const std::uint32_t c : choose(spec.inclusions, std::size_t{perSide} * perSide * perSide, random)) {
        const Index3 cell(c % perSide, c / perSide % perSide, c / perSide / perSide);
        Index3 centre = pitch * cell + reach;
        for (int axis = 0; axis < 3; ++axis) {
            centre[axis] += static_cast<int>(random.bits() % room);
        }
        out.push_back({centre, radius});
    }
    return out;
}

// Voxel (0, 0, 0) of the block is voxel (airVoxels, ..) of the image.
volume::Affine affineOf(int side) noexcept
{
    const double voxel = inclusionBlockSide / side;
    const double middle = (0.5 * side - 0.5 + airVoxels) * voxel;
    return {Mat3(voxel), Vec3(-middle, (0.5 - airVoxels) * voxel, -middle)};
}

void draw(volume::LabelImage& image, const Ball& inclusion)
{
    const int reach = static_cast<int>(inclusion.radius);
    volume::forEachIndex(Index3(-reach), Index3(reach), [&](Index3 d) {
        if (d.x * d.x + d.y * d.y + d.z * d.z <= inclusion.radius * inclusion.radius) {
            image.values[image.offset(inclusion.centre + airVoxels + d)] = ballLabel;
        }
    });
}

}  // namespace

int voxelsFor(std::size_t inclusions) noexcept
{
    return std::max(fewestVoxels, minPitch * cellsFor(inclusions));
}

std::vector<PlacedInclusion> inclusionsOf(const InclusionSpec& spec)
{
    const auto affine = affineOf(sideOf(spec));
    return base::mapped<PlacedInclusion>(ballsOf(spec), [&](const Ball& b) {
        return PlacedInclusion{affine.toPatient(Vec3(b.centre + airVoxels)), b.radius * affine.spacing().x};
    });
}

volume::LabelImage inclusionLabels(const InclusionSpec& spec)
{
    const int side = sideOf(spec);
    const int thick = side + std::max(1, static_cast<int>(std::lround(inclusionBase / inclusionBlockSide * side)));
    volume::LabelImage image;
    image.size = Index3(side, thick, side) + 2 * airVoxels;
    image.affine = affineOf(side);
    image.values.assign(image.offset(Index3(0, 0, image.size.z)), airLabel);
    for (int k = 0; k < side; ++k) {
        for (int j = 0; j < thick; ++j) {
            const auto row = image.offset(Index3(0, j, k) + airVoxels);
            std::fill_n(image.values.begin() + static_cast<std::ptrdiff_t>(row), side, j < side ? fatLabel : boneLabel);
        }
    }
    for (const Ball& b : ballsOf(spec)) {
        draw(image, b);
    }
    return image;
}

std::shared_ptr<const volume::Tissue> inclusionTissue(const InclusionSpec& spec)
{
    const volume::LabelName names[]{{airLabel, "air", "air"},
                                    {fatLabel, "fat", "fat"},
                                    {boneLabel, "base", "bone"},
                                    {ballLabel, "inclusions", "idc_high_grade"}};
    return std::make_shared<const volume::Tissue>(volume::Tissue::fromLabels(
        inclusionLabels(spec), datasets::defaultTissues(), names, {{"inclusions", fmt::format("{}", spec.inclusions)}}));
}

datasets::Scene inclusionScene(const datasets::ModelSettings& settings)
{
    datasets::Scene scene;
    scene.name = "inclusions";
    scene.model = settings;
    scene.target = "base";
    scene.vital = {{"inclusions", 1.0, warnDistance}};
    scene.dffb.mode = datasets::DffbMode::field;
    // As scene "breast" has them.
    scene.dffb.surgery = {0.2, 0.05, 0.3, 100};
    scene.dffb.structure = {1.0, 0.0, 0.3, 0.0};
    scene.dffb.tissue = {0.6, 0.0, 0.3, 0.0};
    scene.dffb.task = {0.1, 0.0, 0.0, 0.0};
    scene.entry = Vec3(0.0);
    scene.aim = Vec3(0, aimDepth, 0);
    return scene;
}

std::size_t ObjectScene::collide(Vec3 tip) const noexcept
{
    std::size_t deepest = none;
    double depth = 0.0;
    for (std::size_t i = 0; i < objects_.size(); ++i) {
        const Vec3 off = tip - objects_[i].centre;
        const double radius = objects_[i].radius;
        if (glm::dot(off, off) < radius * radius && radius - glm::length(off) > depth) {
            deepest = i;
            depth = radius - glm::length(off);
        }
    }
    return deepest;
}

Vec3 ObjectScene::feedback(std::size_t object, Vec3 tip) const noexcept
{
    if (object == none) {
        return Vec3(0.0);
    }
    const Vec3 off = tip - objects_[object].centre;
    const double distance = glm::length(off);
    const Vec3 out = distance > 0.0 ? off / distance : Vec3(0, -1, 0);
    return stiffness_ * (objects_[object].radius - distance) * out;
}

std::array<haptics::Proximity, haptics::maxStructures> ObjectScene::monitor(Vec3 tip) const noexcept
{
    std::array<haptics::Proximity, haptics::maxStructures> near{};
    for (std::size_t i = 0; i < std::min(monitored, objects_.size()); ++i) {
        const Vec3 off = tip - objects_[i].centre;
        const double distance = glm::length(off);
        near[i].distance = distance - objects_[i].radius;
        near[i].away = distance > 0.0 ? off / distance : Vec3(0, -1, 0);
        near[i].vital = i > 0;
        near[i].touching = near[i].distance < 0.0;
    }
    return near;
}

}  // namespace palpate::studies
