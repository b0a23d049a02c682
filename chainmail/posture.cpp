#include <chainmail/posture.h>

#include <chainmail/loaded_body.h>
#include <volume/cell_mixture.h>

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace palpate::chainmail {

namespace {

using volume::Tissue;

constexpr int perEdge = 4;               // samples along a cell
constexpr int room = 3;                  // empty cells around what may hold tissue
constexpr double judged = 0.25;          // fraction of a cell from which on its nodes say how far off a shape is
constexpr double allowed = 0.1;          // voxels, by which the unloaded shape may miss the volume's
constexpr double exactness = 0.004;      // voxels, of a solution
constexpr int maxSolverSteps = 400;      // of a solution
constexpr double solverRounding = 1e-9;  // of a voxel's share
constexpr double firstMargin = 0.01, lastMargin = 0.3;  // around the volume's tissue, for the unloaded one [m]

double finestVoxel(const Tissue& tissue)
{
    const Vec3 voxel = tissue.affine().spacing();
    return std::min({voxel.x, voxel.y, voxel.z});
}

// What fills the cells of the unloaded body, as far as that is known.
struct Filling {
    std::vector<volume::CellMaterial> materials;
    std::vector<double> mass;     // of the volume's tissue in each cell [kg]
    std::vector<float> fraction;  // of each cell that is the volume's tissue [-]
};

// Reads tissue at places of the volume, between voxels' middles by their shares: what a cell is made of must change
// smoothly with where it is, or the search for the unloaded shape does not end. What the border of the volume cuts goes on
// beyond it for `reach`, held.
class CellReader {
public:
    CellReader(const Tissue& tissue, double reach, const PostureSettings& settings)
        : tissue_(tissue),
          labels_(tissue.labels()),
          toIndex_(glm::inverse(tissue.affine().linear)),
          reach_(reach),
          rows_(65536, nullptr),
          scaled_(!tissue.stiffnessMap().points.empty())
    {
        for (const volume::Structure& s : tissue.structures()) {
            const volume::TissueRow& row = tissue.table().rows[s.tissue];
            rows_[s.value] = row.role != volume::Role::air && row.youngsModulus > 0.0 ? &row : nullptr;
        }
        for (const volume::TissueRow& row : tissue.table().rows) {
            const auto relaxation = row.relaxation();
            const double left = 1.0 - relaxation.weights[0] - relaxation.weights[1];
            scale_.push_back(settings.modulus * (settings.relaxed ? left * relaxation.instantaneous() : 1.0));
        }
    }

    // Adds a sample of a cell; returns the mass of the volume's tissue in it and its share, for a weight of 1 [kg/m^3, -].
    // `stiffness`: this thread's.
    std::pair<double, double> add(volume::CellMixture& cell, Vec3 place, double weight,
                                  const Tissue::Reader& stiffness) const
    {
        const Vec3 index = toIndex_ * (place - labels_.affine.origin);
        const Vec3 inside = glm::clamp(index, Vec3(0.0), Vec3(labels_.size - 1));
        const bool beyond = glm::any(glm::greaterThan(glm::abs(inside - index), Vec3(0.5)));
        if (beyond && glm::length(labels_.affine.linear * (inside - index)) > reach_) {
            return {0.0, 0.0};
        }
        const Vec3 low = glm::min(glm::floor(inside), glm::max(Vec3(labels_.size - 2), Vec3(0.0)));
        double density = 0.0, fraction = 0.0;
        for (int corner = 0; corner < 8; ++corner) {
            const Index3 side(corner & 1, corner >> 1 & 1, corner >> 2);
            const Vec3 w = glm::mix(1.0 - (inside - low), inside - low, Vec3(side));
            const double part = w.x * w.y * w.z;
            const Index3 voxel = Index3(low) + side;
            const volume::TissueRow* row = part > solverRounding ? rows_[labels_.values[labels_.offset(voxel)]] : nullptr;
            if (row == nullptr) {
                continue;
            }
            const auto at = static_cast<std::size_t>(row - tissue_.table().rows.data());
            cell.add(*row, weight * part, scale_[at] * factor(*row, voxel, stiffness),
                     beyond || row->fixed || behindSupport(voxel));
            density += beyond ? 0.0 : part * row->density;
            fraction += beyond ? 0.0 : part;
        }
        return {density, fraction};
    }

private:
    bool behindSupport(Index3 voxel) const
    {
        const auto& support = tissue_.support();
        return support && support->height(labels_.affine.toPatient(Vec3(voxel))) < 0.0;
    }

    // What the image makes of the modulus of a voxel's tissue.
    double factor(const volume::TissueRow& row, Index3 voxel, const Tissue::Reader& stiffness) const
    {
        const double here = scaled_ ? stiffness.youngsModulus(labels_.affine.toPatient(Vec3(voxel))) : 0.0;
        return here > 0.0 ? here / row.youngsModulus : 1.0;
    }

    const Tissue& tissue_;
    volume::LabelImage labels_;
    Mat3 toIndex_;
    double reach_;
    std::vector<const volume::TissueRow*> rows_;  // of each label; null: none (65536 x 1)
    std::vector<double> scale_;                   // of each row's modulus
    bool scaled_;                                 // the image scales moduli
};

// The unloaded body on a grid: where its nodes are in the volume, and what it does under a load.
class UnloadedBody {
public:
    UnloadedBody(const Tissue& tissue, const PostureSettings& settings, double spacing, double margin)
        : tissue_(tissue),
          settings_(settings),
          reader_(tissue, spacing, settings),
          cells_(volume::coveringGrid(tissue.box(), spacing, margin + room * spacing))
    {
        nodes_ = {cells_.size + 1, cells_.origin - 0.5 * spacing, spacing};
        taken_.resize(nodes_.count());
        for (std::size_t i = 0; i < taken_.size(); ++i) {
            taken_[i] = nodes_.position(nodes_.node(i));
        }
        u_.assign(nodes_.count(), Vec3(0.0));
    }

    // Whether the body keeps away from the border of the grid.
    bool fill();
    // Goes to equilibrium under this acceleration; from where it is, or from rest. Throws where there is none.
    // @param tolerance  as of LoadedBody::solve() [m]
    void sag(Vec3 acceleration, bool fromRest, double tolerance);
    // Takes what the load has done as the volume's shape. Returns how far off it was, at most [m].
    double correct(double fraction);

    PostureMap map() const;
    double weight() const noexcept { return weight_; }

private:
    template <typename Visit>
    void visitCells(const Visit& visit) const
    {
        volume::forEachIndex(Index3(0), cells_.size - 1, visit);
    }
    void fillCell(Index3 cell, const Tissue::Reader& stiffness);
    std::vector<char> attachedCells(const CellLevel& level) const;
    void spread(std::vector<char> known);

    const Tissue& tissue_;
    const PostureSettings& settings_;
    CellReader reader_;
    volume::NodeGrid cells_, nodes_;  // middles of the cells; their corners
    std::vector<Vec3> taken_;         // of each node: its place in the volume [m]
    std::vector<Vec3> u_;             // and its displacement under the load [m]
    Filling filling_;
    std::vector<char> attached_;  // of each cell: has tissue, and something holds it
    double weight_ = 0;
};

Vec3 trilinear(const std::vector<Vec3>& values, const volume::NodeGrid& nodes, Index3 cell, Vec3 at)
{
    Vec3 sum(0.0);
    for (int c = 0; c < 8; ++c) {
        const Index3 side(c & 1, c >> 1 & 1, c >> 2);
        const Vec3 w = glm::mix(1.0 - at, at, Vec3(side));
        sum += w.x * w.y * w.z * values[nodes.offset(cell + side)];
    }
    return sum;
}

void UnloadedBody::fillCell(Index3 cell, const Tissue::Reader& stiffness)
{
    constexpr double weight = 1.0 / (perEdge * perEdge * perEdge);
    volume::CellMixture mixture;
    double density = 0.0, fraction = 0.0;
    volume::forEachIndex(Index3(0), Index3(perEdge - 1), [&](Index3 s) {
        const Vec3 at = (Vec3(s) + 0.5) / static_cast<double>(perEdge);
        const auto [here, filled] = reader_.add(mixture, trilinear(taken_, nodes_, cell, at), weight, stiffness);
        density += weight * here;
        fraction += weight * filled;
    });
    const std::size_t i = cells_.offset(cell);
    filling_.materials[i] = mixture.material();
    filling_.mass[i] = density * std::pow(cells_.spacing, 3);
    filling_.fraction[i] = static_cast<float>(fraction);
}

bool UnloadedBody::fill()
{
    filling_ = {std::vector<volume::CellMaterial>(cells_.count()), std::vector<double>(cells_.count()),
                std::vector<float>(cells_.count())};
    const volume::Box box = tissue_.box();
    const double reach = cells_.spacing;
    tbb::parallel_for(tbb::blocked_range<int>(0, cells_.size.z, 2), [&](const tbb::blocked_range<int>& slices) {
        const Tissue::Reader stiffness(tissue_);
        volume::forEachIndex(
            Index3(0, 0, slices.begin()), Index3(cells_.size.x - 1, cells_.size.y - 1, slices.end() - 1), [&](Index3 c) {
                Vec3 low(INFINITY), high(-INFINITY);
                volume::forEachIndex(c, c + 1, [&](Index3 n) {
                    low = glm::min(low, taken_[nodes_.offset(n)]);
                    high = glm::max(high, taken_[nodes_.offset(n)]);
                });
                if (!glm::any(glm::greaterThan(low, box.high + reach)) && !glm::any(glm::lessThan(high, box.low - reach))) {
                    fillCell(c, stiffness);
                }
            });
    });
    bool clear = true;
    visitCells([&](Index3 c) {
        const bool border =
            glm::any(glm::lessThan(c, Index3(room - 1))) || glm::any(glm::greaterThan(c, cells_.size - room));
        clear = clear && !(border && filling_.materials[cells_.offset(c)].youngsModulus > 0.0F);
    });
    return clear;
}

// Tissue that hangs on nothing has no equilibrium: cells that share a face, from those that are held.
std::vector<char> UnloadedBody::attachedCells(const CellLevel& level) const
{
    std::vector<char> attached(cells_.count(), 0);
    std::vector<Index3> open;
    const auto solid = [&](Index3 c) { return cells_.contains(c) && level.mu[level.nodes.offset(c)] > 0.0F; };
    visitCells([&](Index3 c) {
        int held = 0;
        volume::forEachIndex(c, c + 1, [&](Index3 n) { held += level.fixed[level.nodes.offset(n)] != 0 ? 1 : 0; });
        if (solid(c) && held >= 3) {
            attached[cells_.offset(c)] = 1;
            open.push_back(c);
        }
    });
    while (!open.empty()) {
        const Index3 c = open.back();
        open.pop_back();
        for (int side = 0; side < 6; ++side) {
            Index3 next = c;
            next[side / 2] += side % 2 == 0 ? 1 : -1;
            if (solid(next) && attached[cells_.offset(next)] == 0) {
                attached[cells_.offset(next)] = 1;
                open.push_back(next);
            }
        }
    }
    return attached;
}

// Gives nodes that no tissue moves the mean of those around them that are moved, layer by layer.
void UnloadedBody::spread(std::vector<char> known)
{
    std::vector<Index3> layer;
    volume::forEachIndex(Index3(0), nodes_.size - 1, [&](Index3 n) {
        if (known[nodes_.offset(n)] != 0) {
            layer.push_back(n);
        }
    });
    while (!layer.empty()) {
        std::vector<Index3> next;
        for (const Index3 n : layer) {
            volume::forEachIndex(glm::max(n - 1, Index3(0)), glm::min(n + 1, nodes_.size - 1), [&](Index3 m) {
                char& state = known[nodes_.offset(m)];
                if (state == 0) {
                    state = 2;
                    next.push_back(m);
                }
            });
        }
        for (const Index3 n : next) {
            Vec3 sum(0.0);
            int count = 0;
            volume::forEachIndex(glm::max(n - 1, Index3(0)), glm::min(n + 1, nodes_.size - 1), [&](Index3 m) {
                if (known[nodes_.offset(m)] == 1) {
                    sum += u_[nodes_.offset(m)];
                    ++count;
                }
            });
            u_[nodes_.offset(n)] = sum / static_cast<double>(count);
        }
        for (const Index3 n : next) {
            known[nodes_.offset(n)] = 1;
        }
        layer = std::move(next);
    }
}

void UnloadedBody::sag(Vec3 acceleration, bool fromRest, double tolerance)
{
    const volume::DistanceField nowhere{{{Index3(2), nodes_.origin, 1.0}, std::vector<float>(8, 1e3F)}};
    const ElasticBody body = elasticBody(cells_, filling_.materials, nowhere, settings_.poissonCap);
    const CellLevel& level = body.levels.front();
    attached_ = attachedCells(level);
    LoadedBody loaded(body);
    std::vector<char> known(nodes_.count(), 0);
    Vec3 weight(0.0);
    visitCells([&](Index3 c) {
        const std::size_t i = cells_.offset(c);
        volume::forEachIndex(c, c + 1, [&](Index3 n) {
            const Vec3 force = 0.125 * filling_.mass[i] * acceleration;
            if (attached_[i] != 0) {
                loaded.load(n, force);
                known[nodes_.offset(n)] = 1;
                weight += level.fixed[level.nodes.offset(n)] == 0 ? force : Vec3(0.0);
            }
        });
    });
    weight_ = glm::length(weight);
    for (std::size_t i = 0; i < u_.size() && !fromRest; ++i) {
        loaded.place(nodes_.node(i), known[i] != 0 ? u_[i] : Vec3(0.0));
    }
    const auto out = loaded.solve(tolerance, maxSolverSteps);
    if (!out.balanced) {
        throw std::runtime_error(
            fmt::format("the body has no equilibrium under its weight: after {} steps {:.2g} of it are out of balance",
                        out.steps, out.residual));
    }
    for (std::size_t i = 0; i < u_.size(); ++i) {
        u_[i] = loaded.displacement(nodes_.node(i));
    }
    spread(std::move(known));
}

double UnloadedBody::correct(double fraction)
{
    double most = 0.0;
    visitCells([&](Index3 c) {
        const std::size_t i = cells_.offset(c);
        if (attached_[i] != 0 && static_cast<double>(filling_.fraction[i]) >= judged) {
            volume::forEachIndex(c, c + 1, [&](Index3 n) {
                const std::size_t at = nodes_.offset(n);
                most = std::max(most, glm::length(nodes_.position(n) + u_[at] - taken_[at]));
            });
        }
    });
    for (std::size_t i = 0; i < taken_.size(); ++i) {
        taken_[i] += fraction * (nodes_.position(nodes_.node(i)) + u_[i] - taken_[i]);
    }
    return most;
}

PostureMap UnloadedBody::map() const
{
    PostureMap map{nodes_, taken_, u_, std::vector<std::uint8_t>(nodes_.count(), 0)};
    for (std::size_t i = 0; i < u_.size(); ++i) {
        map.now[i] += nodes_.position(nodes_.node(i));
    }
    visitCells([&](Index3 c) {
        if (filling_.fraction[cells_.offset(c)] > 0.0F) {
            volume::forEachIndex(glm::max(c - 1, Index3(0)), glm::min(c + 1, cells_.size - 1), [&](Index3 beside) {
                std::uint8_t& filled = map.filled[nodes_.offset(beside)];
                filled = std::max(filled, static_cast<std::uint8_t>(beside == c ? 2 : 1));
            });
        }
    });
    return map;
}

double farthestOf(const PostureMap& map)
{
    double most = 0.0;
    volume::forEachIndex(Index3(0), map.nodes.size - 2, [&](Index3 c) {
        if (map.filled[map.nodes.offset(c)] == 2) {
            Vec3 sum(0.0);
            volume::forEachIndex(c, c + 1, [&](Index3 n) {
                sum += 0.125 * (map.now[map.nodes.offset(n)] - map.taken[map.nodes.offset(n)]);
            });
            most = std::max(most, glm::length(sum));
        }
    });
    return most;
}

// Rounds of the search for the unloaded shape. False where the grid has no room for it.
bool unload(UnloadedBody& body, Vec3 acceleration, double voxel, const PostureSettings& settings, PostureFigures& figures)
{
    double fraction = 1.0, before = INFINITY;
    for (figures.rounds = 0; figures.rounds < settings.maxRounds;) {
        if (!body.fill()) {
            return false;
        }
        body.sag(acceleration, figures.rounds == 0, std::max(exactness * voxel, std::min(0.01 * before, 0.1 * voxel)));
        ++figures.rounds;
        figures.residual = body.correct(fraction);
        if (figures.residual <= allowed * voxel) {
            return true;
        }
        fraction = figures.residual > before ? std::max(0.5 * fraction, 0.25) : fraction;
        before = figures.residual;
    }
    throw std::runtime_error(
        fmt::format("the unloaded shape was not found: after {} rounds it misses the volume's by {:.2g} mm, and {:.2g} "
                    "mm are asked for; is the tissue too soft for its weight?",
                    figures.rounds, 1e3 * figures.residual, 1e3 * allowed * voxel));
}

}  // namespace

Posture postureOf(const Tissue& tissue, const Gravity& gravity, const PostureSettings& settings)
{
    const double voxel = finestVoxel(tissue);
    const bool loaded = gravity.taken != Vec3(0.0);
    for (double margin = loaded ? firstMargin : 0.0; margin < lastMargin; margin *= 2.0) {
        Posture out;
        out.figures.spacing =
            volume::affordableSpacing(tissue.box(), settings.spacing, margin + room * settings.spacing, settings.maxNodes);
        UnloadedBody body(tissue, settings, out.figures.spacing, margin);
        if (loaded && !unload(body, gravity.taken, voxel, settings, out.figures)) {
            continue;
        }
        if (!body.fill()) {
            continue;
        }
        body.sag(gravity.now, true, exactness * voxel);
        out.map = body.map();
        out.figures.weight = body.weight();
        out.figures.farthest = farthestOf(out.map);
        return out;
    }
    throw std::runtime_error(
        fmt::format("the unloaded shape reaches over {:.0f} mm beyond the volume's: is the tissue too "
                    "soft for its weight?",
                    0.5e3 * lastMargin));
}

}  // namespace palpate::chainmail
