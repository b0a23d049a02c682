#pragma once

#include <datasets/phantom.h>
#include <datasets/phantom_random.h>
#include <volume/label_image.h>

#include <functional>
#include <map>
#include <string>
#include <vector>

namespace palpate::datasets {

// Inside the phantoms lengths are in mm, as in their parameters; the label image is in metres.

/// Every parameter of a phantom with its value, checked.
struct PhantomValues {
    std::map<std::string, double> numbers;
    std::map<std::string, std::string> words;
    std::uint64_t seed = 1;
    double voxel = 1;                                         // [mm]
    double memory = std::numeric_limits<double>::infinity();  // that the phantom may take [bytes]

    double number(const std::string& name) const { return numbers.at(name); }
    const std::string& word(const std::string& name) const { return words.at(name); }
};

/// A part of a phantom, and the parameter that says how large it is [mm].
struct PhantomPart {
    std::uint16_t label = 0;
    std::string parameter;
};

/// A phantom's voxels and what they mean.
struct PhantomLabels {
    volume::LabelImage image;
    std::vector<volume::LabelName> names;
    std::vector<PhantomPart> parts;  // that must have a voxel at least
};

PhantomLabels breastPhantom(const PhantomValues& values);
PhantomLabels layeredPhantom(const PhantomValues& values);
PhantomLabels blockPhantom(const PhantomValues& values);
std::vector<PhantomParameter> breastParameters();
std::vector<PhantomParameter> layeredParameters();
std::vector<PhantomParameter> blockParameters();

/// An empty image over the box from `low` to `high` [mm]. With the parameter voxels_per_side it is a cube of that many
/// voxels along each side instead; what the cube has more than the box is air, in front of it and at both sides. Throws
/// std::runtime_error for more voxels than there are at most, or than there is memory for.
volume::LabelImage phantomImage(const PhantomValues& values, Vec3 low, Vec3 high);
/// Centre of a voxel [mm].
Vec3 voxelCentre(const volume::LabelImage& image, Index3 n);
/// Edge of a voxel [mm].
double voxelEdge(const volume::LabelImage& image);
/// Runs `row(j, k)` for every row of voxels along x, in parallel. Rows must not depend on each other.
void forEachRow(const volume::LabelImage& image, const std::function<void(int j, int k)>& row);
/// Visits the voxels whose centre is within `reach` [mm] of the box from `low` to `high` [mm].
void forEachVoxel(const volume::LabelImage& image, Vec3 low, Vec3 high, double reach,
                  const std::function<void(Index3 n, Vec3 centre)>& visit);

/// An irregular lump: lobes from smooth noise, and spicules (thin spikes) where it is malignant.
struct Lump {
    Vec3 centre{0.0};   // [mm]
    double radius = 0;  // of the sphere with the same volume [mm]
    double lobes = 0;   // height of the lobes, fraction of the radius
    std::uint64_t seed = 0;
    std::vector<Vec3> spicules;         // directions
    std::vector<double> spiculeHeight;  // fraction of the radius
    double scale = 1;                   // makes the volume that of the sphere
    double bound = 0;                   // no point is farther from the centre [mm]

    /// Distance from the centre to the surface along the unit vector `direction` [mm].
    double reach(Vec3 direction) const noexcept;
};

/// A lump as `kind` grows: fibroadenoma lobulated, the others with spicules.
Lump makeLump(const std::string& kind, double diameter, Random& random);
/// Points spread over the surface of a lump around the origin [mm].
std::vector<Vec3> surfacePoints(const Lump& lump, int count);
void drawLump(volume::LabelImage& image, const Lump& lump, std::uint16_t label);

/// A piece of a tube, tapering from one end to the other [mm].
struct Tube {
    Vec3 from{0.0}, to{0.0};
    double fromRadius = 0, toRadius = 0;
};

/// How a tree of tubes grows.
struct TreeShape {
    double radius = 1.5;       // at the root [mm]
    double smallest = 0.5;     // radius at which a branch ends [mm]
    double step = 3;           // length of a tube [mm]
    double branchLength = 18;  // of the first branch [mm]; each next one is a fifth shorter
    int levels = 4;            // of branches
    double wander = 0.3;       // random fraction of the direction at every step
    double pull = 0.15;        // fraction of the direction towards the goal
};

/// Grows a tree from `root` towards `goal`; every tube ends where `allowed` (point, radius) holds. Branches that find no
/// way end early. Radii follow Murray's law (cubes add up at a fork).
std::vector<Tube> growTree(const TreeShape& shape, Vec3 root, Vec3 direction, Vec3 goal, Random& random,
                           const std::function<bool(Vec3, double)>& allowed);
/// Draws tubes at least `minRadius` [mm] thick, so that they stay in one piece on coarse grids.
void drawTubes(volume::LabelImage& image, const std::vector<Tube>& tubes, double minRadius, std::uint16_t label,
               const std::function<bool(std::uint16_t)>& over);
double distanceToTube(Vec3 p, const Tube& tube) noexcept;

}  // namespace palpate::datasets
