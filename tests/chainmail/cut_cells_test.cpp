// Cells that their tissue fills in part: where it lies in them, and what it costs to strain it there.
#include "elastic_bodies.h"
#include "elastic_cells.h"

#include <chainmail/cut_cells.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <vector>

namespace palpate::chainmail {
namespace {

using tests::Cells;

struct Moments {
    double share = 0.0;
    Vec3 middle{0.0}, spread{0.0};
};

// Of the parts of a cell that are marked, side x side x side of them.
Moments momentsOf(const std::vector<bool>& marked, int side)
{
    Moments m;
    Vec3 first(0.0), second(0.0);
    const double part = 1.0 / (side * side * side);
    for (std::size_t i = 0; i < marked.size(); ++i) {
        const auto at = static_cast<int>(i);
        const Vec3 place =
            2.0 * (Vec3(at % side, at / side % side, at / side / side) + 0.5) / static_cast<double>(side) - 1.0;
        if (marked[i]) {
            m.share += part;
            first += part * place;
            second += part * (place * place + 1.0 / (3.0 * side * side));
        }
    }
    m.middle = first / m.share;
    m.spread = 3.0 * (second / m.share - m.middle * m.middle);
    return m;
}

// Of the block of parts of this size at `low`, level by level; nothing where nothing is marked.
std::optional<Cut> cutOfBlock(const std::vector<bool>& marked, int side, Index3 low, int size)
{
    CutSum sum;
    bool any = false;
    for (int i = 0; i < 8; ++i) {
        const Index3 at = low + size / 2 * octant(i);
        const bool isMarked = marked[static_cast<std::size_t>(at.x + side * (at.y + side * at.z))];
        const auto child = size > 2   ? cutOfBlock(marked, side, at, size / 2)
                           : isMarked ? std::optional(Cut{})
                                      : std::nullopt;
        if (child) {
            sum.add(*child, octant(i));
            any = true;
        }
    }
    return any ? std::optional(sum.cut()) : std::nullopt;
}

// Three levels of cells, whatever is marked: the coarsest knows the first and second moments of the finest's tissue, but
// for the cells that are full to 98 % and count as full.
TEST(CutCells, ACoarseCellHasTheMomentsOfItsTissue)
{
    constexpr int side = 8;
    std::minstd_rand random(3);
    for (int i = 0; i < 200; ++i) {
        const Vec3 n = tests::randomLayer(Index3(0), random).normal;
        const double off = std::uniform_real_distribution<double>(-0.8, 0.8)(random);
        std::vector<bool> marked(side * side * side);
        for (std::size_t k = 0; k < marked.size(); ++k) {
            const auto at = static_cast<int>(k);
            const Vec3 p =
                2.0 * (Vec3(at % side, at / side % side, at / side / side) + 0.5) / static_cast<double>(side) - 1.0;
            marked[k] = i % 2 == 0 ? random() % 4 == 0 : glm::dot(p, n) < off;
        }
        const Cut cut = cutOfBlock(marked, side, Index3(0), side).value_or(Cut{});
        if (const Moments m = momentsOf(marked, side); m.share > 0.01 && m.share < 0.97) {
            EXPECT_NEAR(static_cast<double>(cut.share), m.share, 0.02);
            for (int k = 0; k < 3; ++k) {
                EXPECT_NEAR(static_cast<double>(cut.middle[k]), m.middle[k], 0.02);
                EXPECT_NEAR(static_cast<double>(cut.spread[k]), std::clamp(m.spread[k], 0.02, 1.0), 0.04);
            }
        }
    }
}

// A flat surface at any height, along any axis, from either side: the tissue is a slab of the cell.
TEST(CutCells, AFlatSurfaceLeavesASlab)
{
    const volume::NodeGrid grid{Index3(9), Vec3(-4.0), 1.0};
    for (int axis = 0; axis < 3; ++axis) {
        for (const double side : {-1.0, 1.0}) {
            for (const double full : {0.15, 0.3, 0.5, 0.77, 0.9}) {
                const auto surface = tests::distanceOn(grid, [&](Vec3 p) { return 0.5 - full - side * p[axis]; });
                volume::CellMaterial material = tests::tissue(1e4, 0.45);
                material.fraction = static_cast<float>(full);
                const Cut cut = cutBy(surface, Vec3(0.0), 1.0, material);
                EXPECT_EQ(cut.share, material.fraction);
                for (int k = 0; k < 3; ++k) {
                    EXPECT_NEAR(static_cast<double>(cut.middle[k]), k == axis ? side * (1.0 - full) : 0.0, 1e-4) << full;
                    EXPECT_NEAR(static_cast<double>(cut.spread[k]), k == axis ? full * full : 1.0, 1e-4) << full;
                }
            }
        }
    }
}

// Where the surface's field has nothing, as in tissue that is thinner than its spacing, eighths say where the tissue is.
TEST(CutCells, WhereTheSurfacePassesByEighthsCount)
{
    const volume::NodeGrid grid{Index3(9), Vec3(-4.0), 1.0};
    const auto nowhere = tests::distanceOn(grid, [](Vec3) { return 2.0; });
    volume::CellMaterial material = tests::tissue(1e4, 0.45);
    material.fraction = 0.4F;
    material.octants = 0x0F;  // the lower half along z
    const Cut cut = cutBy(nowhere, Vec3(0.0), 1.0, material);
    EXPECT_EQ(cut.middle, Vec3f(0.0F, 0.0F, -0.5F));
    EXPECT_EQ(cut.spread, Vec3f(1.0F, 1.0F, 0.25F));
    EXPECT_EQ(cut.share, 0.4F);
    material.octants = 0;
    EXPECT_EQ(cutBy(nowhere, Vec3(0.0), 1.0, material).middle, Vec3f(0.0F));
}

// The tissue of a cell that the surface runs through turns around its own middle, which is not the cell's: there nothing is
// stretched, and so is no contact.
TEST(CutCells, AContactStretchesAsTheTissueOfItsCell)
{
    tests::ElasticBlock block = tests::heldBlock({12, 8, 12}, 2e-3, 1e4, 0.45);
    block.full = 0.6;
    block.air = 4;
    const ElasticBody body = tests::bodyOf(block);
    WindowStack stack(body, 15, tests::focusUnder({12e-3, 0.0, 12e-3}));
    int cut = 0;
    for (std::uint32_t i = 0; i < body.points.size(); i += 7) {
        ContactSite site;
        site.point = i;
        locate(body, stack.windows(), Vec3(body.points[i].anchor), site);
        const Vec3 middle(stack[site.level].cuts.at(site.node).middle);
        cut += middle != Vec3(0.0) ? 1 : 0;
        const auto& grid = body.levels[site.level].nodes;
        const Index3 cell(glm::floor((Vec3(body.points[i].anchor) - grid.origin) / grid.spacing));
        const Vec3 at = grid.position(cell) + 0.5 * grid.spacing * (1.0 + middle);
        tests::setField(stack, Field::u, [&](Vec3 rest) {
            const Vec3 x = (rest - at) / grid.spacing;
            return 3.0 * grid.spacing * Vec3(x.x * x.y, x.y * x.z, x.z * x.x);
        });
        EXPECT_NEAR(StretchAt(stack, volume::NeoHookean{})(site).area, 1.0, 1e-4) << i;
    }
    EXPECT_GT(cut, 5);
}

// Tissue in the lower part of a cell, bent by the curvature K along x and L along z around its own middle: a plate of its
// thickness t, (K^2 + L^2 + 2 nu K L) E t^3 / 24 (1 - nu^2). Around the middle of the cell it is stretched as well.
TEST(CutCells, ASlabInACellBendsAsAPlate)
{
    const double e = 3.0;
    for (const double nu : {0.0, 0.3, 0.47}) {
        for (const double t : {0.2, 0.5, 0.8}) {
            const double mu = t * e / (2.0 * (1.0 + nu)), lambda = t * e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu));
            const auto energy = [&](double around, double across) {
                Cells cells(Index3(2));
                cells.set(Index3(0), mu, lambda);
                cells.setLayers({}, {{Index3(0),
                                      {Vec3f(0.0F, static_cast<float>(t - 1.0), 0.0F),
                                       Vec3f(1.0F, static_cast<float>(t * t), 1.0F), static_cast<float>(t)}}});
                cells.move([&](Index3 n) {
                    const Vec3 x = Vec3(n) - 0.5;
                    return Vec3(x.x * (x.y - around), 0.0, across * x.z * (x.y - around));
                });
                cells.apply();
                return 0.5 * dot(cells, cells.u, cells.out);
            };
            for (const double across : {0.0, 1.0, -1.0, -nu}) {
                const double plate = (1.0 + across * across + 2.0 * nu * across) * e * t * t * t / (24.0 * (1.0 - nu * nu));
                const double middle = 0.5 * (t - 1.0);
                EXPECT_NEAR(energy(middle, across), plate, 1e-5 * e) << nu << " " << t;
                const Vec3 strain = middle * Vec3(1.0, 0.0, across);
                const double stretch = mu * glm::dot(strain, strain) + 0.5 * lambda * std::pow(strain.x + strain.z, 2);
                EXPECT_NEAR(energy(0.0, across), plate + stretch, 1e-5 * e) << nu << " " << t;
            }
        }
    }
}

// What a smoother takes for the diagonal is the operator's, on the mean of its three directions, but that tissue bends as
// if it were as wide as the cell.
TEST(CutCells, DiagonalIsTheOperatorsOfTissueAsWideAsTheCell)
{
    std::minstd_rand random(4);
    for (int i = 0; i < 20; ++i) {
        const Vec3f middle = i == 0 ? Vec3f(0.0F) : tests::randomCut(random).middle;
        const Cut cut{.middle = middle};
        const double mu = 2.0, lambda = i % 2 == 0 ? 1.0 : 50.0;
        Cells cells(Index3(2));
        cells.set(Index3(0), mu, lambda);
        cells.setLayers({}, {{Index3(0), cut}});
        for (int corner = 0; corner < 8; ++corner) {
            double sum = 0.0;
            for (int k = 0; k < 3; ++k) {
                cells.move([&](Index3 n) { return n == octant(corner) ? Vec3(k == 0, k == 1, k == 2) : Vec3(0.0); });
                cells.apply();
                sum += cells.force(octant(corner))[k];
            }
            const auto ours = static_cast<double>(
                diagonalOf(static_cast<float>(mu), static_cast<float>(lambda), 1.0, cut, sideOf(corner)));
            EXPECT_NEAR(sum / 3.0, ours, 1e-5 * ours) << i << " " << corner;
        }
    }
}

// A plate of two cells, and one of half a cell and two, bent to a cylinder: at every level it has a plate's energy. With
// tissue spread over its cells it had four times that where they are twice as high as the plate.
TEST(CutCells, EveryLevelBendsAsThePlate)
{
    const double e = 1e4, h = 1e-3, curvature = 0.5;
    for (const double full : {1.0, 0.5}) {
        tests::ElasticBlock block{
            {32, full < 1.0 ? 3 : 2, 32}, h, [&](Index3 c) { return tests::tissue(e, 0.0, c == Index3(0)); }, 4, Vec3(0.0)};
        block.full = full;
        const ElasticBody body = tests::bodyOf(block);
        const double thick = (block.cells.y - 1 + full) * h;
        const double middle = block.cells.y * h - 0.5 * thick;
        const double plate = curvature * curvature * std::pow(32.0 * h, 2) * e * std::pow(thick, 3) / 24.0;
        for (std::size_t l = 0; l < 3; ++l) {
            const CellLevel& level = body.levels.at(l);
            Window w(level, level.nodes.size, false);
            w.place(level, Index3(0), nullptr, false);
            volume::forEachIndex(Index3(0), level.nodes.size - 1, [&](Index3 n) {
                const Vec3 p = level.nodes.position(n) - Vec3(16.0 * h, middle, 0.0);
                w.set(Field::u, w.layout.at(n.x, n.y, n.z), curvature * Vec3(p.x * p.y, -0.5 * p.x * p.x, 0.0));
            });
            Floats scratch(w.layout.scratchSize());
            kernels().apply(w.layout, w.stiffness(), w.field(Field::u), w.field(Field::t), scratch.data());
            double energy = 0.0;
            volume::forEachIndex(Index3(0), level.nodes.size - 1, [&](Index3 n) {
                const std::size_t at = w.layout.at(n.x, n.y, n.z);
                energy += 0.5 * glm::dot(w.value(Field::u, at), w.value(Field::t, at));
            });
            const bool countsAsFuller = full < 1.0 && l == 0;  // see withoutSliver()
            EXPECT_NEAR(energy / plate, 1.0, countsAsFuller ? 0.025 : 0.01) << full << ", level " << l;
        }
    }
}

}  // namespace
}  // namespace palpate::chainmail
