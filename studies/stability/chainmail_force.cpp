#include <haptics/bounded.h>
#include <studies/stability/method.h>

#include <chainmail/propagate.h>

#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::studies {

namespace {

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
        double most = 0.0;
        for (const Vec3f& d : u) {
            most = std::max(most, static_cast<double>(glm::length(d)));
        }
        return most;
    }

    MethodScene scene;
    const chainmail::Lattice& lattice;
    std::vector<Vec3f> u;  // displacement of each node [m]
    chainmail::PropagateScratch scratch;
    std::vector<chainmail::Seed> seeds;
};

}  // namespace

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
