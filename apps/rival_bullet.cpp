// palpate-rival-bullet: Bullet's deformable bodies on a push of `palpate accuracy`. Settings are those of Bullet's example
// VolumetricDeformable, where docs/accuracy.md does not say otherwise.
#include <apps/rival_push.h>
#include <base/error.h>
#include <base/mapped.h>
#include <base/processor_time.h>

#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>
#include <BulletSoftBody/btDeformableBodySolver.h>
#include <BulletSoftBody/btDeformableMultiBodyConstraintSolver.h>
#include <BulletSoftBody/btDeformableMultiBodyDynamicsWorld.h>
#include <BulletSoftBody/btDeformableNeoHookeanForce.h>
#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <btBulletDynamicsCommon.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <ranges>
#include <set>
#include <utility>
#include <vector>

namespace palpate::apps {

namespace {

// Bullet's examples are bodies of about one unit: the sphere has a radius of 1 when lengths are in centimetres.
constexpr double perMetre = 100.0;
constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
constexpr double unlocked = 0.45;  // Poisson's ratio at which linear tetrahedra do not lock yet
constexpr double margin = 0.01;    // of the body's surface [cm]
constexpr double sdfVoxel = 0.05;  // of the grid that the sphere is sampled on [cm]: 0.25 turns normals by 8 degrees
constexpr double decay = 20.0;     // of velocities [1/s], or the body rings
constexpr double toolMass = 1e3;   // so heavy that contacts hardly slow it [kg]
constexpr double safeStep = 0.8;   // of the least time in which a wave crosses a tetrahedron

btVector3 unitsOf(Vec3 metres)
{
    return {perMetre * metres.x, perMetre * metres.y, perMetre * metres.z};
}

Vec3 vectorOf(const btVector3& v)
{
    return {v.x(), v.y(), v.z()};
}

struct World {
    btSoftBodyRigidBodyCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    btDeformableBodySolver bodySolver;
    btDeformableMultiBodyConstraintSolver constraintSolver;
    btDeformableMultiBodyDynamicsWorld world{&dispatcher, &broadphase, &constraintSolver, &configuration, &bodySolver};

    World()
    {
        constraintSolver.setDeformableSolver(&bodySolver);
        world.setGravity({0, 0, 0});
        world.getWorldInfo().m_gravity.setZero();
        world.getWorldInfo().m_sparsesdf.setDefaultVoxelsz(sdfVoxel);
        world.getWorldInfo().m_sparsesdf.Reset();
        // The implicit step lets the sphere through.
        world.setImplicit(false);
        world.setLineSearch(false);
        world.setUseProjection(true);
        auto& info = world.getSolverInfo();
        info.m_deformable_erp = 0.3;
        info.m_deformable_maxErrorReduction = 200;
        info.m_leastSquaresResidualThreshold = 1e-3;
        info.m_splitImpulse = true;
        info.m_numIterations = 100;
    }
};

// Links of a mesh: its trees are built along them.
void addLinks(btSoftBody& body, const RivalPush& push)
{
    std::set<std::pair<std::uint32_t, std::uint32_t>> links;
    for (const auto& tet : push.tets) {
        for (std::size_t i = 0; i < 4; ++i) {
            for (std::size_t j = 0; j < i; ++j) {
                links.insert(std::minmax(tet[i], tet[j]));
            }
        }
    }
    for (const auto& [a, b] : links) {
        body.appendLink(static_cast<int>(a), static_cast<int>(b));
    }
}

void addMasses(btSoftBody& body, const RivalPush& push)
{
    std::vector<double> mass(push.points.size(), 0.0);
    for (std::size_t t = 0; t < push.tets.size(); ++t) {
        for (const std::uint32_t p : push.tets[t]) {
            mass[p] += 0.25 * push.density * push.tetVolume(t);
        }
    }
    for (std::size_t p = 0; p < mass.size(); ++p) {
        body.setMass(static_cast<int>(p), mass[p]);
    }
    for (const std::uint32_t p : push.held) {
        body.setMass(static_cast<int>(p), 0.0);  // does not move
    }
}

std::unique_ptr<btSoftBody> bodyOf(const RivalPush& push, btSoftBodyWorldInfo& info)
{
    const auto points = base::mapped<btVector3>(push.points, [&](const Vec3& p) { return unitsOf(p); });
    auto body = std::make_unique<btSoftBody>(&info, static_cast<int>(points.size()), points.data(), nullptr);
    addLinks(*body, push);
    for (const auto& t : push.tets) {
        body->appendTetra(static_cast<int>(t[0]), static_cast<int>(t[1]), static_cast<int>(t[2]), static_cast<int>(t[3]));
    }
    for (const auto& f : push.triangles) {
        body->appendFace(static_cast<int>(f[0]), static_cast<int>(f[1]), static_cast<int>(f[2]));
    }
    addMasses(*body, push);
    body->getCollisionShape()->setMargin(margin);
    body->m_cfg.kKHR = 1;
    body->m_cfg.kCHR = 1;
    body->m_cfg.kDF = 0;
    body->m_cfg.collisions = btSoftBody::fCollision::SDF_RD | btSoftBody::fCollision::SDF_RDN;
    body->m_sleepingThreshold = 0;
    body->setActivationState(DISABLE_DEACTIVATION);
    body->setSpringStiffness(0);
    body->initializeDmInverse();
    body->m_tetraScratches.resize(body->m_tetras.size());
    body->m_tetraScratchesTn.resize(body->m_tetras.size());
    return body;
}

// Of the softest tissue, which moves most, as for all: stiffness is by tetrahedron, but this is not.
double poissonOf(const RivalPush& push)
{
    return std::min(unlocked, std::ranges::min_element(push.materials, {}, &RivalMaterial::youngsModulus)->poisson);
}

// One law for the whole body is what Bullet has: tetrahedra that are stiffer count with a larger volume. Its energy is that
// of Smith et al. 2018, whose constants are 4/3 mu and lambda + 5/6 mu where mu and lambda are those of small strain.
btDeformableNeoHookeanForce lawOf(const RivalPush& push, btSoftBody& body)
{
    const double modulus = push.materials.at(push.material.at(0)).youngsModulus;
    const double poisson = poissonOf(push);
    const double mu = modulus / (2.0 * (1.0 + poisson)) / perMetre;  // [kg / (cm s^2)]
    const double lambda = 2.0 * mu * poisson / (1.0 - 2.0 * poisson);
    for (std::size_t t = 0; t < push.tets.size(); ++t) {
        body.m_tetras[static_cast<int>(t)].m_element_measure *= push.materials[push.material[t]].youngsModulus / modulus;
    }
    return {4.0 / 3.0 * mu, lambda + 5.0 / 6.0 * mu, 0.0};
}

// Steps of a tick: a pressure wave must not cross a tetrahedron in one.
int stepsOf(const RivalPush& push)
{
    const double nu = poissonOf(push);
    const double wave = (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu));  // modulus, as a multiple of Young's
    const std::set<std::uint32_t> held(push.held.begin(), push.held.end());
    double least = push.tick;
    for (std::size_t t = 0; t < push.tets.size(); ++t) {
        const auto& tet = push.tets[t];
        if (std::ranges::all_of(tet, [&](std::uint32_t p) { return held.contains(p); })) {
            continue;
        }
        double largest = 0.0;  // face
        for (std::size_t i = 0; i < 4; ++i) {
            const Vec3 a = push.points[tet[(i + 1) % 4]], b = push.points[tet[(i + 2) % 4]],
                       c = push.points[tet[(i + 3) % 4]];
            largest = std::max(largest, 0.5 * glm::length(glm::cross(b - a, c - a)));
        }
        const double speed = std::sqrt(wave * push.materials[push.material[t]].youngsModulus / push.density);
        least = std::min(least, 3.0 * push.tetVolume(t) / largest / speed);
    }
    return static_cast<int>(std::ceil(push.tick / (safeStep * least)));
}

class Bullet {
public:
    explicit Bullet(const RivalPush& push)
        : push_(push),
          steps_(stepsOf(push)),
          body_(bodyOf(push, world_.world.getWorldInfo())),
          law_(lawOf(push, *body_)),
          sphere_(perMetre * push.radius - margin),
          tool_(rigidInfo())
    {
        body_->m_cfg.drag = 1.0 - std::exp(-decay * step());
        world_.world.addSoftBody(body_.get());
        world_.world.addForce(body_.get(), &law_);
        tool_.setFriction(0);
        tool_.setDamping(0, 0);
        tool_.setActivationState(DISABLE_DEACTIVATION);
        place(push.centre.at(0));
        world_.world.addRigidBody(&tool_);
    }
    ~Bullet()
    {
        world_.world.removeRigidBody(&tool_);
        world_.world.removeSoftBody(body_.get());
    }

    // The sphere goes straight from one centre to the other. Returns the force on it, the mean of its contacts' impulses
    // [N].
    Vec3 tick(Vec3 from, Vec3 to)
    {
        const btVector3 velocity = unitsOf(to - from) / push_.tick;
        btVector3 impulse(0, 0, 0);  // [kg cm/s]
        for (int s = 1; s <= steps_; ++s) {
            tool_.setLinearVelocity(velocity);
            tool_.setAngularVelocity({0, 0, 0});
            world_.world.stepSimulation(step(), 0, step());
            impulse += toolMass * (tool_.getLinearVelocity() - velocity);
            place(from + static_cast<double>(s) / steps_ * (to - from));
        }
        return vectorOf(impulse) / (perMetre * push_.tick);
    }
    std::vector<Vec3> displacements() const
    {
        return base::mapped<Vec3>(std::views::iota(0UL, push_.points.size()), [&](std::size_t p) {
            return vectorOf(body_->m_nodes[static_cast<int>(p)].m_x) / perMetre - push_.points[p];
        });
    }

private:
    double step() const noexcept { return push_.tick / steps_; }

    btRigidBody::btRigidBodyConstructionInfo rigidInfo()
    {
        btVector3 inertia;
        sphere_.calculateLocalInertia(toolMass, inertia);
        return {toolMass, nullptr, &sphere_, inertia};
    }
    void place(Vec3 centre)
    {
        const btTransform at(btQuaternion::getIdentity(), unitsOf(centre));
        tool_.setWorldTransform(at);
        tool_.setInterpolationWorldTransform(at);
    }

    const RivalPush& push_;
    int steps_;  // of a tick
    World world_;
    std::unique_ptr<btSoftBody> body_;
    btDeformableNeoHookeanForce law_;
    btSphereShape sphere_;
    btRigidBody tool_;
};

// The push without points that no tetrahedron has: Bullet's trees are made along the links, and would be without end.
// `place` has the new number of each point; those left out have that of none.
RivalPush connected(const RivalPush& push, std::vector<std::uint32_t>& place)
{
    place.assign(push.points.size(), none);
    RivalPush out = push;
    out.points.clear();
    const auto renumber = [&](auto& corners) {
        for (std::uint32_t& p : corners) {
            if (place.at(p) == none) {
                place[p] = static_cast<std::uint32_t>(out.points.size());
                out.points.push_back(push.points[p]);
            }
            p = place[p];
        }
    };
    std::ranges::for_each(out.tets, renumber);
    std::ranges::for_each(out.triangles, renumber);
    out.held.clear();
    for (const std::uint32_t p : push.held) {
        if (place.at(p) != none) {
            out.held.push_back(place[p]);
        }
    }
    return out;
}

// Of all points of the push: those left out stay.
std::vector<Vec3> spread(const std::vector<Vec3>& u, const std::vector<std::uint32_t>& place)
{
    return base::mapped<Vec3>(place, [&](const std::uint32_t p) { return p == none ? Vec3(0.0) : u[p]; });
}

RivalResults solve(const RivalPush& whole)
{
    std::vector<std::uint32_t> place;
    const RivalPush push = connected(whole, place);
    Bullet bullet(push);
    RivalResults results;
    for (std::size_t t = 0; t < push.centre.size(); ++t) {
        const double start = base::processorTime();
        const Vec3 force = bullet.tick(push.centre[t == 0 ? 0 : t - 1], push.centre[t]);
        const double took = base::processorTime() - start;
        base::failIf(!std::isfinite(glm::length(force)), "tick {}: the force is not finite: the body has come apart", t);
        if (force != Vec3(0.0)) {
            results.seconds.push_back(took);
        }
        if (std::ranges::find(push.looks, t) != push.looks.end()) {
            results.u.push_back(spread(bullet.displacements(), place));
            results.force.push_back(force);
        }
    }
    return results;
}

}  // namespace

}  // namespace palpate::apps

int main(int argc, char** argv)
{
    using namespace palpate::apps;
    return rivalMain(argc, argv, "palpate-rival-bullet",
                     "Solves a push of `palpate accuracy` with Bullet's deformable bodies",
                     [](const RivalPush& push, const std::filesystem::path&) { return solve(push); });
}
