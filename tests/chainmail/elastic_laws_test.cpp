// Laws of finite strain as the cells see them: each of the list, and one that only this file knows.
#include "elastic_cells.h"

#include <gtest/gtest.h>

#define PALPATE_LANES 4
#include <chainmail/kernels_body.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::chainmail {
namespace {

using tests::Cells;

// W = mu/2 (I + b I^3): Yeoh's third term.
struct Cubic {
    static constexpr bool finite = true;

    template <typename Number>
    static volume::Stiffening<Number> beyond(Number mu, Number b, Number i) noexcept
    {
        return {0.5F * mu * b * i * i * i, 3.0F * mu * b * i * i, 6.0F * mu * b * i};
    }
};

template <typename Law>
double applyOf(Cells& cells)
{
    return applyLaw<Law>(cells.layout, cells.stiffness(), 1.0F, cells.u.data(), cells.out.data(), cells.scratch.data());
}

// Energy of a homogeneous stretch, per volume: neo-Hookean's and what the law has beyond it.
template <typename Law>
void expectItsEnergy(double b)
{
    constexpr double mu = 2.0, lambda = 30.0;
    for (const Vec3 stretch : {Vec3(1.3, 0.9, 0.8), Vec3(1.6, 0.8, 0.8), Vec3(0.7, 1.2, 1.2), Vec3(2.5, 0.6, 0.7)}) {
        Cells cells({12, 6, 5});
        cells.fill(mu, lambda);
        cells.stiffen(b);
        cells.move([&](Index3 n) { return (stretch - 1.0) * Vec3(n); });
        const double j = stretch.x * stretch.y * stretch.z - 1.0;
        const double i = volume::isochoric(glm::dot(stretch, stretch) - 3.0 - 2.0 * j, j).i;
        const double density = 0.5 * mu * i + 0.5 * (lambda + 2.0 / 3.0 * mu) * j * j + Law::beyond(mu, b, i).energy;
        EXPECT_NEAR(applyOf<Law>(cells), density * 11 * 5 * 4, 2e-5 * density * 220) << b << " " << i;
    }
}

// dE/dt along v is v.f, by central differences.
template <typename Law>
void expectItsForce(double b)
{
    std::minstd_rand random(3);
    Cells cells({11, 6, 7});
    cells.fillRandom(random);
    cells.stiffen(b);
    Cells shifted = cells, direction = cells;
    for (int trial = 0; trial < 5; ++trial) {
        cells.moveRandom(0.3, random);
        applyOf<Law>(cells);
        direction.moveRandom(1.0, random);
        const auto energy = [&](float t) {
            for (std::size_t n = 0; n < shifted.u.size(); ++n) {
                shifted.u[n] = cells.u[n] + t * direction.u[n];
            }
            return applyOf<Law>(shifted);
        };
        constexpr double step = 2e-3;
        const double slope = (energy(static_cast<float>(step)) - energy(static_cast<float>(-step))) / (2.0 * step);
        const double scale = std::sqrt(dot(cells, cells.out, cells.out) * dot(cells, direction.u, direction.u));
        EXPECT_NEAR(slope, dot(cells, direction.u, cells.out), 2e-3 * scale) << b;
    }
}

template <typename Law>
void expectBoth()
{
    if constexpr (Law::finite) {
        for (const double b : {-0.25, 0.0, 0.4, 3.0}) {
            expectItsEnergy<Law>(b);
            expectItsForce<Law>(b);
        }
    }
}

// I by its series is J^(-2/3) I_C - 3, and its derivatives are those of it, inverted cells included.
TEST(ElasticLaws, TheInvariantOfCellsIsTheIsochoricOne)
{
    for (const double change : {-0.35, -0.2, -0.05, 0.0, 0.1, 0.3}) {
        for (const double shape : {0.05, 0.5, 4.0, 30.0}) {
            const double whole = std::pow(1.0 + change, -2.0 / 3.0) * (shape + 3.0 + 2.0 * change) - 3.0;
            EXPECT_NEAR(volume::isochoric(shape, change).i, whole, 0.02 * whole + 0.02 * std::abs(change))
                << change << shape;
        }
    }
    for (const double change : {-3.0, -0.8, -0.3, 0.0, 0.3, 0.59, 2.0}) {
        const double shape = 2.0, step = 1e-4;
        const auto at = volume::isochoric(shape, change);
        EXPECT_NEAR((volume::isochoric(shape + step, change).i - volume::isochoric(shape - step, change).i) / (2.0 * step),
                    at.byShape, 1e-5);
        EXPECT_NEAR((volume::isochoric(shape, change + step).i - volume::isochoric(shape, change - step).i) / (2.0 * step),
                    at.byVolume, 1e-3)
            << change;
    }
}

TEST(ElasticLaws, EnergyAndForceOfEveryLawAreItsOwn)
{
    const auto all = []<std::size_t... I>(std::index_sequence<I...>)
    {
        (expectBoth<std::variant_alternative_t<I, volume::Law>>(), ...);
    };
    all(std::make_index_sequence<volume::lawCount>());
}

TEST(ElasticLaws, ALawNeedsOnlyToBeAType)
{
    expectItsEnergy<Cubic>(0.4);
    expectItsForce<Cubic>(0.4);
}

// Through the table of the kernels, every law on every set of instructions, to the bit.
TEST(ElasticLaws, EverySetGivesTheSameBits)
{
    std::minstd_rand random(2);
    Cells cells({21, 6, 7});
    cells.fillRandom(random);
    cells.moveRandom(0.4, random);
    cells.stiffen(2.2);
    for (const volume::Law& law : volume::laws) {
        if (volume::isSmall(law)) {
            continue;
        }
        Floats first;
        double energy = 0.0;
        for (const Kernels* k : supportedKernels()) {
            CellStiffness stiffness = cells.stiffness();
            stiffness.law = law.index();
            const double now =
                k->applyFinite(cells.layout, stiffness, 1.0F, cells.u.data(), cells.out.data(), cells.scratch.data());
            if (first.empty()) {
                first = cells.out;
                energy = now;
            }
            EXPECT_EQ(cells.out, first) << k->name << " " << volume::nameOf(law);
            EXPECT_EQ(now, energy) << k->name << " " << volume::nameOf(law);
        }
    }
}

// Rows that are empty, whole without stiffening, whole with it, and cut: with the same bits whether the sweep knows it or
// not.
TEST(ElasticLaws, RowsOfAnyFillingGiveTheForcesOfTheirCells)
{
    for (const int wide : {15, 21}) {
        std::minstd_rand random(3);
        Cells cells({wide, 6, 7});
        std::vector<CutCell> cut;
        volume::forEachIndex(Index3(0), cells.nodes() - 2, [&](Index3 c) {
            const int filling = (c.y + c.z) % 4;
            cells.set(c, filling == 0 ? 0.0 : 1.0 + c.x, filling == 0 ? 0.0 : 30.0);
            cells.stiffening[cells.layout.at(c.x, c.y, c.z)] = filling == 2 ? 2.2F : 0.0F;
            if (filling == 3) {
                cut.push_back({c, tests::randomCut(random)});
            }
        });
        cells.setLayers({}, cut);
        cells.moveRandom(0.4, random);
        Cells known = cells;
        known.cuts.classify(known.mu, known.stiffening);
        for (const Filling filling : {Filling::whole, Filling::cut, Filling::empty, Filling::constant}) {
            const auto* all = known.cuts.filling();
            EXPECT_NE(std::find(all, all + known.layout.count / Layout::lanes, filling),
                      all + known.layout.count / Layout::lanes);
        }
        const auto energy = [](Cells& of, const Kernels& k, std::size_t law) {
            CellStiffness stiffness = of.stiffness();
            stiffness.law = law;
            return k.applyFinite(of.layout, stiffness, 1.0F, of.u.data(), of.out.data(), of.scratch.data());
        };
        for (const Kernels* k : supportedKernels()) {
            for (const volume::Law& law : volume::laws) {
                if (!volume::isSmall(law)) {
                    cells.relief = known.relief = volume::nameOf(law) == "neo-hookean" ? 1.0F : 0.0F;
                    EXPECT_EQ(energy(cells, *k, law.index()), energy(known, *k, law.index())) << k->name;
                    EXPECT_EQ(cells.out, known.out) << k->name << " " << volume::nameOf(law) << " " << wide;
                }
            }
            k->apply(cells.layout, cells.stiffness(), cells.u.data(), cells.out.data(), cells.scratch.data());
            k->apply(known.layout, known.stiffness(), known.u.data(), known.out.data(), known.scratch.data());
            EXPECT_EQ(cells.out, known.out) << k->name << " " << wide;
        }
    }
}

// A bar pulled along x between planes on which nothing holds it across: nominal stress by the closed form of tissue that
// keeps its volume. The body is one cell: its width is found by halving.
TEST(ElasticLaws, ABarUnderTensionFollowsTheClosedForm)
{
    constexpr double mu = 1.0, lambda = 2e4;
    for (const volume::Law& law : volume::laws) {
        if (volume::isSmall(law)) {
            continue;
        }
        for (const double b : {-0.2, 0.0, 2.0, 7.0}) {
            for (const double stretch : {0.8, 1.1, 1.3, 1.5}) {
                Cells cells({2, 2, 2});
                cells.fill(mu, lambda);
                cells.stiffen(b);
                CellStiffness stiffness = cells.stiffness();
                stiffness.law = law.index();
                const auto forceAt = [&](double width) {
                    cells.move([&](Index3 n) { return (Vec3(stretch, width, width) - 1.0) * Vec3(n); });
                    kernels().applyFinite(cells.layout, stiffness, 1.0F, cells.u.data(), cells.out.data(),
                                          cells.scratch.data());
                    return cells.force({1, 1, 1});
                };
                double low = 0.7, high = 1.3;
                for (int halved = 0; halved < 40; ++halved) {
                    const double middle = 0.5 * (low + high);
                    (forceAt(middle).y > 0.0 ? high : low) = middle;
                }
                const double i = stretch * stretch + 2.0 / stretch - 3.0;
                const double x = b * (b < 0.0 ? std::min(i, 1.0) : i);
                const double shear =
                    law == volume::Law(volume::Exponential{}) ? mu * std::exp(std::min(x, 4.0)) : mu * (1.0 + x);
                const double stress = shear * (stretch - 1.0 / (stretch * stretch));
                EXPECT_NEAR(4.0 * forceAt(low).x, stress, 0.01 * std::abs(stress))
                    << volume::nameOf(law) << " " << b << " " << stretch;
            }
        }
    }
}

}  // namespace
}  // namespace palpate::chainmail
