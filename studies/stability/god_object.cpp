#include <haptics/bounded.h>
#include <studies/stability/method.h>

#include <glm/geometric.hpp>

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

}  // namespace

// Source: Zilles and Salisbury, "A constraint-based god-object method for haptic display", IROS 1995; on the faces of voxels.
StabilityMethod godObject()
{
    return {"god_object", [](const MethodScene& scene) -> RunningMethod {
                auto god = std::make_shared<GodObject>(
                    GodObject{scene, ContactVoxels(scene.model), volume::Tissue::Reader(*scene.model.tissue)});
                return {[god](const haptics::DeviceSample& sample) { return god->tick(sample); }};
            }};
}

}  // namespace palpate::studies
