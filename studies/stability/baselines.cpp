#include <base/folds.h>
#include <chainmail/propagate.h>
#include <haptics/bounded.h>
#include <studies/stability/method.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <limits>

namespace palpate::studies {

namespace {

constexpr int maxCrossings = 4096;  // of voxel faces on one way
constexpr double godGap = 1e-6;     // between god-object and a face, in voxels

// What stops a point on its way: the axis of the face, or -1 when nothing does. `p` goes as far as it gets. In voxels.
int travel(const ContactVoxels& voxels, Vec3& p, Vec3 to) noexcept
{
    const Vec3 way = to - p;
    Index3 n(glm::floor(p));
    double done = 0.0;
    for (int i = 0; i < maxCrossings; ++i) {
        int axis = -1;
        double first = 1.0;
        for (int a = 0; a < 3; ++a) {
            const double face = way[a] > 0.0 ? n[a] + 1 : n[a];
            const double at = way[a] != 0.0 ? (face - p[a]) / way[a] : std::numeric_limits<double>::infinity();
            if (at < first) {
                first = at;
                axis = a;
            }
        }
        if (axis < 0) {
            p = to;
            return -1;
        }
        Index3 next = n;
        next[axis] += way[axis] > 0.0 ? 1 : -1;
        if (voxels.solid(next)) {
            const double hit = std::max(first, done);
            const double face = way[axis] > 0.0 ? n[axis] + 1 - godGap : n[axis] + godGap;
            p += hit * way;
            p[axis] = face;
            return axis;
        }
        done = first;
        n = next;
    }
    return -1;
}

// The point nearest to the device that a point can slide to: the planes of the faces that stop it are its constraints, at
// most three.
struct GodObject {
    MethodScene scene;
    ContactVoxels voxels;
    volume::Tissue::Reader reader;
    Vec3 point{0.0};  // in voxels
    bool started = false;

    Vec3 tick(const haptics::DeviceSample& sample) noexcept
    {
        const Vec3 device = voxels.inVoxels(sample.position);
        if (!started) {
            point = device;
            started = true;
        }
        Vec3 goal = device;
        for (int planes = 0; planes < 3; ++planes) {
            const int axis = travel(voxels, point, goal);
            if (axis < 0) {
                break;
            }
            goal[axis] = point[axis];
        }
        const Vec3 push = (point - device) * voxels.grid.spacing;
        const double depth = glm::length(push);
        if (depth <= 0.0) {
            return Vec3(0.0);
        }
        const Vec3 surface = sample.position + push;
        return haptics::bounded(contactStiffness(scene, reader, surface, -push / depth) * push, capOf(scene));
    }
};

constexpr int furthest = 64;  // voxels that are looked through for the way out

// The way out of the solid from `p` along one side of one axis, in voxels.
double wayOut(const ContactVoxels& voxels, Vec3 p, int axis, int side) noexcept
{
    Index3 n(voxels.voxel(p));
    const double at = voxels.inVoxels(p)[axis];
    for (int i = 0; i < furthest && voxels.solid(n); ++i) {
        n[axis] += side;
    }
    return side > 0 ? n[axis] - at : at - (n[axis] + 1);
}

// The nearest face of the surface pushes out along its normal, and so do faces that are no voxel farther: their forces
// add up.
Vec3 depthVector(const ContactVoxels& voxels, Vec3 p) noexcept
{
    std::array<double, 6> out{};
    for (int s = 0; s < 6; ++s) {
        out[static_cast<std::size_t>(s)] = wayOut(voxels, p, s / 2, s % 2 != 0 ? 1 : -1);
    }
    const double reach = *std::min_element(out.begin(), out.end()) + 1.0;
    Vec3 sum(0.0);
    for (int s = 0; s < 6; ++s) {
        const double way = out[static_cast<std::size_t>(s)];
        sum[s / 2] += way < reach ? (s % 2 != 0 ? way : -way) : 0.0;
    }
    return sum * voxels.grid.spacing;
}

// One layer at a time is there to be touched. When it gives way it is removed for good, and its flag keeps a force along
// the needle until the next layer is touched: also in a gap, and also in the air outside.
struct Layers {
    MethodScene scene;
    volume::Tissue::Reader reader;
    double front = 0;  // of the tool's foremost point ahead of its position [m]
    std::array<bool, haptics::maxTissues> removed{};
    std::uint8_t touched = 0;  // layer in contact; 0 = none
    std::uint8_t flagged = 0;  // removed layer whose force goes on; 0 = none

    const volume::TissueRow& row(std::uint8_t r) const noexcept { return scene.model.tissue->table().rows[r]; }

    // From the surface of what is not removed to the tip, along the tool: the surface contact point stays there [m].
    double depthBelow(Vec3 tip, Vec3 axis) const noexcept
    {
        constexpr double step = 0.1e-3, furthest = 50e-3;
        double depth = 0.0;
        while (depth < furthest) {
            const auto here = reader.tissue(tip - depth * axis);
            if (here == 0 || removed[here]) {
                break;
            }
            depth += step;
        }
        return depth;
    }

    Vec3 tick(const haptics::DeviceSample& sample) noexcept
    {
        const Vec3 tip = sample.position + front * sample.axis;
        const auto here = reader.tissue(tip);
        if (touched == 0 && here != 0 && !removed[here]) {
            touched = here;
            flagged = 0;
        }
        if (touched == 0) {
            return haptics::bounded(-row(flagged).cuttingForce * sample.axis, capOf(scene));
        }
        const double depth = depthBelow(tip, sample.axis);
        if (depth <= 0.0) {
            touched = 0;
            return Vec3(0.0);
        }
        const double force = contactStiffness(scene, reader, tip - depth * sample.axis, sample.axis) * depth;
        if (force > row(touched).punctureForce) {
            removed[touched] = true;
            flagged = touched;
            touched = 0;
        }
        return haptics::bounded(-force * sample.axis, capOf(scene));
    }
};

using chainmail::Node;

// ChainMail goes on from the shape of the tick before, and nothing relaxes it. The nodes in the tool are put onto its
// surface; their links, stretched as springs, make the force.
struct ChainMailForce {
    static constexpr std::uint32_t maxMoves = 5000;
    static constexpr std::size_t maxSeeds = 4096;

    explicit ChainMailForce(const MethodScene& at)
        : scene(at), lattice(at.model.lattice), u(lattice.grid.count(), Vec3f(0.0F)), scratch(lattice, maxMoves, maxSeeds)
    {
        seeds.reserve(maxSeeds);
    }

    Vec3 tick(const haptics::DeviceSample& sample) noexcept
    {
        hold(sample);
        scratch.clear();
        chainmail::propagate(lattice, u, scratch, seeds);
        Vec3 force(0.0);
        for (const auto& seed : seeds) {
            const double k = scene.model.youngsModulus.at(rest(seed.node)) * lattice.grid.spacing;
            for (int side = 0; side < 6; ++side) {
                const Node other = lattice.beside(seed.node, side);
                if (lattice.isNode(other)) {
                    force += k * Vec3(u[other] - u[seed.node]);
                }
            }
        }
        return haptics::bounded(force, capOf(scene));
    }

    Vec3 rest(Node n) const noexcept { return lattice.grid.position(lattice.grid.node(n)); }

    // The tool is widened to one spacing where the lattice could not see it.
    void hold(const haptics::DeviceSample& sample) noexcept
    {
        seeds.clear();
        const double radius = std::max(scene.model.scene.tool.radius, lattice.grid.spacing);
        for (Node n = 0; n < u.size() && seeds.size() < maxSeeds; ++n) {
            if (!lattice.isNode(n) || lattice.isFixed(n)) {
                continue;
            }
            const Vec3 away = rest(n) + Vec3(u[n]) - sample.position;
            const double distance = glm::length(away);
            if (distance < radius && distance > 0.0) {
                const Vec3 onto = sample.position + radius / distance * away;
                seeds.push_back({n, Vec3f(onto - rest(n))});
            }
        }
    }

    double furthest() const noexcept
    {
        return base::largestOf(u, [](Vec3f d) { return static_cast<double>(glm::length(d)); });
    }

    MethodScene scene;
    const chainmail::Lattice& lattice;
    std::vector<Vec3f> u;  // displacement of each node [m]
    chainmail::PropagateScratch scratch;
    std::vector<chainmail::Seed> seeds;
};

}  // namespace

// Source: Zilles and Salisbury, "A constraint-based god-object method for haptic display", IROS 1995; on the faces of
// voxels.
StabilityMethod godObject()
{
    return {"god_object", [](const MethodScene& scene) -> RunningMethod {
                auto god = std::make_shared<GodObject>(
                    GodObject{scene, ContactVoxels(scene.model), volume::Tissue::Reader(*scene.model.tissue)});
                return {[god](const haptics::DeviceSample& sample) { return god->tick(sample); }};
            }};
}

// K d along the gradient of the distance to the surface.
StabilityMethod penalty()
{
    return {"penalty", [](const MethodScene& scene) -> RunningMethod {
                auto reader = std::make_shared<const volume::Tissue::Reader>(*scene.model.tissue);
                const bool ball = scene.model.scene.tool.kind != datasets::ToolKind::needle;
                const double radius = ball ? scene.model.scene.tool.radius : 0.0;
                return {[=](const haptics::DeviceSample& sample) {
                    const double depth = radius - scene.model.surface.distance(sample.position);
                    if (depth <= 0.0) {
                        return Vec3(0.0);
                    }
                    const Vec3 normal = scene.model.surface.normal(sample.position);
                    const double k = contactStiffness(scene, *reader, sample.position - radius * normal, -normal);
                    return haptics::bounded(k * depth * normal, capOf(scene));
                }};
            }};
}

// Source: Massie and Salisbury, "The PHANToM haptic interface: a device for probing virtual objects", ASME 1994.
StabilityMethod superposedNormals()
{
    return {"superposed_normals", [](const MethodScene& scene) -> RunningMethod {
                auto voxels = std::make_shared<const ContactVoxels>(scene.model);
                auto reader = std::make_shared<const volume::Tissue::Reader>(*scene.model.tissue);
                return {[=](const haptics::DeviceSample& sample) {
                    if (!voxels->solid(voxels->voxel(sample.position))) {
                        return Vec3(0.0);
                    }
                    const Vec3 depth = depthVector(*voxels, sample.position);
                    const double k = contactStiffness(scene, *reader, sample.position, sample.axis);
                    return haptics::bounded(k * depth, capOf(scene));
                }};
            }};
}

// The layer-based model of the thesis that Palpate started from.
StabilityMethod layers()
{
    const auto start = [](const MethodScene& scene) -> RunningMethod {
        const auto& tool = scene.model.scene.tool;
        const double front = tool.kind == datasets::ToolKind::needle ? 0.0 : tool.radius;
        auto state = std::make_shared<Layers>(Layers{scene, volume::Tissue::Reader(*scene.model.tissue), front});
        return {[state](const haptics::DeviceSample& sample) { return state->tick(sample); }};
    };
    return {"layers", start, datasets::ModelLevel::spring, true};
}

// Source: Gibson, "3D ChainMail", I3D 1997: shapes that build on each other, no elastic relaxation.
StabilityMethod chainMailForce()
{
    const auto start = [](const MethodScene& scene) -> RunningMethod {
        auto state = std::make_shared<ChainMailForce>(scene);
        return {[state](const haptics::DeviceSample& sample) { return state->tick(sample); },
                [state] { return state->furthest(); }};
    };
    return {"chainmail_force", start, datasets::ModelLevel::chainmail};
}

}  // namespace palpate::studies
