#include <haptics/session_model.h>

#include <base/error.h>
#include <chainmail/deformation.h>
#include <chainmail/loose_pieces.h>
#include <datasets/scene_text.h>
#include <haptics/posed.h>
#include <haptics/probe_placement.h>

#include <fmt/ranges.h>
#include <tbb/parallel_for_each.h>
#include <tbb/parallel_invoke.h>
#include <glm/common.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace palpate::haptics {

namespace {

// Fields finer than this are not felt: half the width of a 14 G needle.
constexpr double finestField = 0.75e-3;
constexpr double finestSurface = 0.5e-3;  // where it is a whole number of voxels
constexpr double equalEdges = 1e-6;       // relative
constexpr std::size_t surfaceNodes = 4U << 20;
constexpr std::size_t structureNodes = 1U << 20;
constexpr std::size_t latticeNodes = 4U << 20;

volume::NodeGrid fieldGrid(const volume::Tissue& tissue, std::size_t nodes)
{
    const Vec3 voxel = tissue.affine().spacing();
    const double wanted = std::max(finestField, std::min({voxel.x, voxel.y, voxel.z}));
    const double margin = 4.0 * wanted;
    return volume::coveringGrid(tissue.box(), volume::affordableSpacing(tissue.box(), wanted, margin, nodes), margin);
}

// The edge of voxels that are cubes along the axes of the body; 0 for others [m].
double cubeEdge(const volume::Affine& affine)
{
    const double edge = affine.spacing().x;
    for (int k = 0; k < 3; ++k) {
        const Vec3 along = glm::abs(affine.linear[k]);
        const double longest = std::max({along.x, along.y, along.z});
        if (std::abs(longest - edge) > equalEdges * edge || along.x + along.y + along.z - longest > equalEdges * edge) {
            return 0.0;
        }
    }
    return edge;
}

// Of the surface: faces of voxels lie at the same places of its cells everywhere. Else the surface is up to a tenth of a
// millimetre off, by where the volume's origin is.
volume::NodeGrid surfaceGrid(const volume::Tissue& tissue)
{
    const double edge = cubeEdge(tissue.affine());
    if (edge <= 0.0) {
        return fieldGrid(tissue, surfaceNodes);
    }
    const Vec3 corner = tissue.affine().origin - 0.5 * edge;
    for (double times = std::max(1.0, std::ceil(finestSurface / edge - equalEdges));; ++times) {
        const double spacing = times * edge;
        Vec3 shift = corner - spacing * glm::round(corner / spacing);
        for (int k = 0; k < 3; ++k) {
            shift[k] = std::abs(shift[k]) > equalEdges * spacing ? shift[k] : 0.0;
        }
        const volume::Box box = tissue.box();
        auto grid = volume::coveringGrid({box.low - shift, box.high - shift}, spacing, 4.0 * spacing);
        if (grid.count() <= surfaceNodes) {
            grid.origin += shift;
            return grid;
        }
    }
}

chainmail::Lattice latticeOf(const datasets::Scene& scene, const volume::Tissue& tissue)
{
    const bool elastic = scene.model.level == datasets::ModelLevel::elastic;
    const double wanted = elastic ? scene.model.elastic.spacing : scene.model.spacing;
    const auto grid = volume::affordableGrid(tissue.box(), wanted, latticeNodes);
    return {grid, tissue.tissueOn(grid), tissue.table()};
}

std::shared_ptr<const chainmail::ElasticBody> elasticOf(const datasets::Scene& scene, const volume::Tissue& tissue,
                                                        const volume::NodeGrid& cells, const volume::DistanceField& surface)
{
    if (scene.model.level != datasets::ModelLevel::elastic) {
        return nullptr;
    }
    const double presses = scene.tool.kind == datasets::ToolKind::needle ? 0.0 : scene.tool.radius;
    auto materials = tissue.materialOn(cells, surface);
    chainmail::holdLoosePieces(cells, materials, tissue.support());
    return std::make_shared<chainmail::ElasticBody>(chainmail::elasticBody(cells, std::move(materials), surface,
                                                                           scene.model.elastic.poissonCap, presses,
                                                                           scene.model.relaxation, tissue.support()));
}

bool anyWalls(const volume::Tissue& tissue)
{
    return std::ranges::any_of(tissue.structures(),
                               [&](const auto& s) { return tissue.table().rows[s.tissue].wallSpacing > 0.0; });
}

// Without its distances.
GuardedStructure guarded(const volume::Tissue& tissue, const std::string& name, const std::string& what,
                         const std::string& scene)
{
    GuardedStructure s;
    s.name = name;
    s.labels = tissue.labelsNamed(name);
    if (s.labels.empty()) {
        throw base::error("{}: {} '{}' is not in the volume; it has: {}", scene, what, name,
                          fmt::join(datasets::solidNames(tissue), ", "));
    }
    return s;
}

std::vector<GuardedStructure> structuresOf(const datasets::Scene& scene, const volume::Tissue& tissue)
{
    std::vector<GuardedStructure> structures;
    structures.push_back(guarded(tissue, scene.target, "target", scene.name));
    for (const auto& vital : scene.vital) {
        structures.push_back(guarded(tissue, vital.name, "vital structure", scene.name));
        structures.back().warnDistance = vital.warnDistance;
        structures.back().gain = vital.gain;
    }
    return structures;
}

// A plan that names a point alone samples the structure in which the point lies.
std::string structureAt(const volume::Tissue& tissue, Vec3 aim, const std::string& scene)
{
    const std::uint16_t label = volume::Tissue::Reader(tissue).label(aim);
    const auto at = std::ranges::find(tissue.structures(), label, &volume::Structure::value);
    base::failIf(at == tissue.structures().end() || tissue.table().rows[at->tissue].role == volume::Role::air,
                 "{}: [target] aim_mm = [{:g}, {:g}, {:g}] lies outside the body", scene, 1e3 * aim.x, 1e3 * aim.y,
                 1e3 * aim.z);
    return at->name;
}

void checkToolFits(const datasets::Scene& scene, const chainmail::Lattice& lattice)
{
    constexpr std::size_t maxSeeds = 1U << 16;  // nodes that a tool may hold: beyond, a tick has no time for them
    base::failIf(chainmail::maxPressSeeds(lattice, scene.tool.radius) > maxSeeds,
                 "{}: a tool of {:g} mm radius is too large for a lattice of {:g} mm: raise [model{}] spacing_mm",
                 scene.name, 1e3 * scene.tool.radius, 1e3 * lattice.grid.spacing,
                 scene.model.level == datasets::ModelLevel::elastic ? ".elastic" : "");
}

// The planned line. A probe that is to lie over the target gets its place. The scene keeps the places of its text.
datasets::Approach approachOf(datasets::Scene& scene, const Posed& posture, const volume::DistanceField& surface,
                              const std::vector<GuardedStructure>& structures)
{
    datasets::Scene planned = scene;
    planned.entry = posture.entry;
    planned.aim = posture.aim;
    if (!scene.probe.overTarget) {
        return datasets::planApproach(planned, *posture.tissue);
    }
    const ProbePlan plan = planProbe(planned, *posture.tissue, surface, structures);
    scene.probe.face = plan.face;
    scene.probe.direction = plan.direction;
    scene.probe.lateral = plan.lateral;
    return plan.approach;
}

datasets::Approach approachIfAny(datasets::Scene& scene, const Posed& posture, const volume::DistanceField& surface,
                                 const std::vector<GuardedStructure>& structures)
{
    try {
        return approachOf(scene, posture, surface, structures);
    } catch (const std::runtime_error&) {
        return {Vec3(0.0), Vec3(0.0), false};
    }
}

}  // namespace

SessionModel buildModel(datasets::Scene scene, std::shared_ptr<const volume::Tissue> tissue, bool isSession)
{
    datasets::checkScene(scene);
    base::failIf(!tissue, "{}: a model needs the scene's volume, and there is none", scene.name);
    base::failIf(tissue->table().rows.size() > maxTissues || scene.vital.size() + 1 > maxStructures,
                 "{}: at most {} tissues and {} vital structures are supported", scene.name, maxTissues, maxStructures - 1);
    base::failIf(scene.model.walls && !anyWalls(*tissue),
                 "{}: [model] walls = true, but no tissue of the volume has inner walls: give one of them wall_spacing_mm "
                 "and wall_n in [tissue.NAME]",
                 scene.name);
    const Posed posture = posed(scene, std::move(tissue));
    tissue = posture.tissue;
    if (scene.target.empty() && posture.aim) {
        scene.target = structureAt(*tissue, *posture.aim, scene.name);
    }
    const auto grid = surfaceGrid(*tissue);
    const auto coarse = fieldGrid(*tissue, structureNodes);
    std::vector<GuardedStructure> structures = structuresOf(scene, *tissue);
    volume::DistanceField surface;
    volume::ScalarField modulus;
    // The sweeps of one field are two threads' work at most.
    tbb::parallel_invoke([&] { surface = tissue->distanceToBody(grid); },
                         [&] { modulus = tissue->youngsModulusOn(coarse); },
                         [&] {
                             tbb::parallel_for_each(structures, [&](GuardedStructure& structure) {
                                 structure.distance = tissue->distanceTo(structure.labels, coarse);
                             });
                         });
    const auto approach =
        isSession ? approachOf(scene, posture, surface, structures) : approachIfAny(scene, posture, surface, structures);
    auto lattice = latticeOf(scene, *tissue);
    if (isSession) {
        checkToolFits(scene, lattice);
    }
    auto elastic = elasticOf(scene, *tissue, lattice.grid, surface);
    return {std::move(scene),   std::move(tissue),     approach,
            std::move(surface), std::move(modulus),    std::move(lattice),
            std::move(elastic), std::move(structures), posture.figures};
}

SessionModel buildModel(datasets::Scene scene, bool isSession)
{
    auto tissue = std::make_shared<const volume::Tissue>(datasets::sceneVolume(scene));
    return buildModel(std::move(scene), std::move(tissue), isSession);
}

}  // namespace palpate::haptics
