#include <chainmail/elastic.h>

#include <tests/chainmail/elastic_bodies.h>

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <random>
#include <vector>

namespace palpate::chainmail {
namespace {

constexpr double cellSpacing = 2e-3;
constexpr double period = 2e-3;          // of a call [s]
constexpr double relaxingModulus = 1e4;  // [Pa]
const Vec3 onTop(15e-3, 0.0, 15e-3);

using Weights = std::array<float, volume::relaxationTerms>;

volume::CellMaterial relaxing(double youngsModulus, double poissonRatio, Weights weights, bool fixed = false)
{
    volume::CellMaterial m = tests::tissue(youngsModulus, poissonRatio, fixed);
    m.relaxing = weights;
    return m;
}

// 30 x 20 x 30 mm on a floor, all of one tissue.
ElasticBody blockOf(Weights weights, double poissonRatio = 0.45)
{
    const tests::ElasticBlock block{{15, 10, 15},
                                    cellSpacing,
                                    [=](Index3 c) { return relaxing(relaxingModulus, poissonRatio, weights, c.y == 9); },
                                    1,
                                    Vec3(0.0)};
    return tests::bodyOf(block, 0.4999, true);
}

ElasticOptions ofStrain(bool finite, int window = 15)
{
    ElasticOptions options;
    options.window = window;
    options.law = finite ? volume::Law(volume::NeoHookean{}) : volume::Law();
    options.period = period;
    return options;
}

// A point of the block on a spring whose other end is led up and down. All displacements are multiples of the point's own
// answer: one mode, with a stiffness that relaxes as the tissue does.
class Led {
public:
    explicit Led(const ElasticBody& body) : elastic_(body, ofStrain(false), tests::focusUnder(onTop)) {}

    // Force of the spring on the tissue, one period later, its end at `u` [N].
    double to(double u)
    {
        const std::array ties{Tie{at, {0.0, u, 0.0}, {0.0, 1.0, 0.0}, spring, spring}};
        elastic_.relax(tests::loadOf({}, ties, onTop), 12, 1e-5);
        return spring * (u - elastic_.displacement(at).y);
    }
    Elastic& elastic() { return elastic_; }

    static constexpr double spring = 200.0;  // [N/m]

private:
    const Vec3 at = onTop + Vec3(0.0, 4e-3, 0.0);
    Elastic elastic_;
};

// Of the tissue at that point right after a step [N/m].
double stiffnessOf(const ElasticBody& body)
{
    constexpr double u = 1e-3;
    Led led(body);
    double force = 0.0;
    for (int i = 0; i < 2; ++i) {
        force = led.to(u);
    }
    return force / (u - force / Led::spring);
}

// A standard linear solid K (1 - w (1 - exp(-t / T))) on a spring k relaxes with the rate ((1 - w) K + k) / (K + k) / T
// from U / (1 / k + 1 / K) to U / (1 / k + 1 / ((1 - w) K)).
TEST(Relaxation, HeldForceIsAStandardLinearSolids)
{
    for (const auto& [weights, term, seconds] :
         {std::tuple(Weights{0.4F, 0.0F}, 0, 2.0), std::tuple(Weights{0.0F, 0.6F}, 1, 10.0)}) {
        const ElasticBody body = blockOf(weights);
        const double w = static_cast<double>(weights[static_cast<std::size_t>(term)]);
        const double time = volume::relaxationTimes[static_cast<std::size_t>(term)];
        const double tissue = stiffnessOf(body), k = Led::spring, u = 1e-3;
        const double first = u / (1.0 / k + 1.0 / tissue), last = u / (1.0 / k + 1.0 / ((1.0 - w) * tissue));
        const double rate = ((1.0 - w) * tissue + k) / (tissue + k) / time;
        Led led(body);
        for (int i = 0; i < static_cast<int>(seconds / period); ++i) {
            const double force = led.to(u);
            ASSERT_NEAR(force, last + (first - last) * std::exp(-rate * i * period), 0.006 * first) << i;
        }
    }
}

// Right after a step the modulus is such that a second later it is the table's.
TEST(Relaxation, TissueHasItsTablesModulusASecondAfterAStep)
{
    const volume::Relaxation relaxation{{0.38, 0.3}};
    EXPECT_NEAR(relaxation.instantaneous() * relaxation.remaining(volume::modulusTime), 1.0, 1e-12);
    EXPECT_NEAR(relaxation.remaining(1e9), 1.0 - 0.38 - 0.3, 1e-12);
    const ElasticBody soft = blockOf({0.0F, 0.0F}), body = blockOf({0.38F, 0.3F});
    EXPECT_NEAR(stiffnessOf(body) / stiffnessOf(soft), relaxation.instantaneous(), 1e-3);
}

// Led up and down by U sin(w t) the spring loses pi U^2 Im D(w) in a turn, D = 1 / (1 / k + 1 / K(w)) and
// K(w) = K (1 - sum of w_i / (1 + i w t_i)).
TEST(Relaxation, WorkOfALoopIsThatOfTheComplexModulus)
{
    const Weights weights{0.35F, 0.25F};
    const ElasticBody body = blockOf(weights);
    const double tissue = stiffnessOf(body), u = 1e-3;
    for (const double frequency : {0.1, 0.32, 1.0, 3.0}) {
        const double omega = 2.0 * std::numbers::pi * frequency;
        std::complex<double> fraction(1.0);
        for (std::size_t i = 0; i < weights.size(); ++i) {
            fraction -= static_cast<double>(weights[i]) / (1.0 + std::complex(0.0, omega * volume::relaxationTimes[i]));
        }
        const double lost = std::numbers::pi * u * u * std::imag(1.0 / (1.0 / Led::spring + 1.0 / (tissue * fraction)));
        Led led(body);
        const int turn = static_cast<int>(std::lround(1.0 / frequency / period));
        double work = 0.0, forceBefore = 0.0;
        for (int i = 1; i <= 3 * turn; ++i) {
            const double force = led.to(u * std::sin(omega * i * period));
            const double way = u * (std::sin(omega * i * period) - std::sin(omega * (i - 1) * period));
            work += i > 2 * turn ? 0.5 * (force + forceBefore) * way : 0.0;
            forceBefore = force;
        }
        EXPECT_NEAR(work, lost, 0.03 * lost) << frequency << " Hz";
    }
}

// Whatever its end is led along, a spring on tissue that was at rest has never got work out of it.
TEST(Relaxation, NoPathFromRestGivesWork)
{
    const ElasticBody body = blockOf({0.45F, 0.45F});
    std::minstd_rand random(3);
    std::uniform_real_distribution<double> to(-1e-3, 1e-3), speed(1e-3, 50e-3);
    for (int path = 0; path < 4; ++path) {
        Led led(body);
        double at = 0.0, work = 0.0, forceBefore = 0.0, put = 0.0;
        for (int leg = 0; leg < 12; ++leg) {
            const double end = leg == 11 ? 0.0 : to(random);
            const double step = speed(random) * period;
            while (at != end) {
                const double next = at < end ? std::min(at + step, end) : std::max(at - step, end);
                const double force = led.to(next);
                work += 0.5 * (force + forceBefore) * (next - at);
                put += std::abs(0.5 * (force + forceBefore) * (next - at));
                forceBefore = force;
                at = next;
                ASSERT_GT(work, -1e-3 * put);
            }
        }
        EXPECT_GT(work, 0.0);
    }
}

// Two layers at nu = 0 under an even load are two standard linear solids in series, each of which creeps by itself:
// strain = s / E (1 + w / (1 - w) (1 - exp(-(1 - w) t / T))). Cells of two tissues side by side keep histories of their
// own.
TEST(Relaxation, LayersInSeriesCreepEachByItsOwnWeights)
{
    const int cells = 8;
    const Weights upper{0.5F, 0.0F}, lower{0.0F, 0.7F};
    const tests::ElasticBlock block{
        {cells, cells + 1, cells},
        cellSpacing,
        [=](Index3 c) { return relaxing(relaxingModulus, 0.0, c.y < cells / 2 ? upper : lower, c.y == cells); },
        1,
        Vec3(0.0)};
    const ElasticBody body = tests::bodyOf(block, 0.4999, true);
    const Vec3 middle(0.5 * cells * cellSpacing, 0.0, 0.5 * cells * cellSpacing);
    Elastic elastic(body, ofStrain(false, 21), tests::focusUnder(middle));
    ASSERT_EQ(elastic.stack().size(), 2U);
    constexpr double soft = 1e-3, pull = 1.0;  // springs that give next to nothing [N/m], and the way of their ends [m]
    std::vector<Tie> ties;
    for (int i = 0; i < cells * cells; ++i) {
        const Vec3 at(cellSpacing * (i % cells + 0.5), 1e-6, cellSpacing * (i / cells + 0.5));
        ties.push_back({at, {0.0, pull, 0.0}, {0.0, 1.0, 0.0}, soft, soft});
    }
    const double stress = soft * pull / (cellSpacing * cellSpacing);
    const auto strain = [&](double w, double time, double t) {
        const double instantaneous =
            relaxingModulus * volume::Relaxation{{w * (time < 1.0), w * (time > 1.0)}}.instantaneous();
        return stress / instantaneous * (1.0 + w / (1.0 - w) * (1.0 - std::exp(-(1.0 - w) * t / time)));
    };
    const double height = 0.5 * cells * cellSpacing;
    const Vec3 border = middle + Vec3(0.0, height, 0.0);
    for (int i = 0; i < 2000; ++i) {
        elastic.relax(tests::loadOf({}, ties, middle), 12, 1e-5);
        const double t = i * period;
        const double ofLower = height * strain(0.7, volume::relaxationTimes[1], t);
        const double ofUpper = height * strain(0.5, volume::relaxationTimes[0], t);
        ASSERT_NEAR(elastic.displacement(border - Vec3(0, 1e-6, 0)).y, ofLower, 0.01 * ofLower) << t;
        ASSERT_NEAR(elastic.displacement(middle + Vec3(0, 1e-6, 0)).y, ofLower + ofUpper, 0.01 * (ofLower + ofUpper)) << t;
    }
}

double heldShare(bool finite, double depth, Weights weights, double seconds)
{
    const ElasticBody body = blockOf(weights);
    Elastic elastic(body, ofStrain(finite), tests::focusUnder(onTop));
    constexpr double radius = 6e-3;
    std::array tools{tests::ball(onTop + Vec3(0.0, -radius, 0.0), radius, 1e4)};
    const auto press = [&](double deep) {
        tools[0].shape.a = tools[0].shape.b = onTop + Vec3(0.0, deep - radius, 0.0);
        tools[0].pushed = Vec3(0.0, deep, 0.0);
        elastic.relax(tests::loadOf(tools, {}, onTop));
        return -elastic.toolForce(0).y;
    };
    double peak = 0.0, force = 0.0;
    for (int i = 1; i <= 20; ++i) {
        peak = press(depth * std::min(i, 10) / 10.0);
    }
    for (int i = 0; i < static_cast<int>(seconds / period); ++i) {
        force = press(depth);
    }
    return force / peak;
}

// A ball that is held keeps G(t) of its force, at any strain: all histories are multiples of one force. The springs of the
// contact do not relax, so that a little tissue comes back under the ball: more where it touches less than two cells.
TEST(Relaxation, HeldBallKeepsTheShareOfTheSeriesAtAnyStrain)
{
    const Weights weights{0.4F, 0.3F};
    const volume::Relaxation relaxation{{0.4, 0.3}};
    for (const bool finite : {false, true}) {
        for (const double depth : {1.5e-3, 5e-3}) {
            const double held = heldShare(finite, depth, weights, 3.0);
            EXPECT_NEAR(held, relaxation.remaining(3.0), depth < 2e-3 ? 0.04 : 0.025) << finite << ", " << depth;
        }
    }
}

// Let go, tissue comes back by itself, and when next to nothing is left it is at rest to the bit.
TEST(Relaxation, TissueThatIsLetGoComesBackToExactRest)
{
    const ElasticBody body = blockOf({0.5F, 0.0F});
    Led led(body);
    for (int i = 0; i < 1000; ++i) {
        led.to(2e-3);
    }
    const Vec3 at = onTop + Vec3(0.0, 4e-3, 0.0);
    double before = led.elastic().displacement(at).y;
    int calls = 0;
    for (; !led.elastic().atRest() && calls < 4000; ++calls) {
        led.elastic().relax(tests::loadOf({}, {}, onTop), 12, 1e-3);
        const double now = led.elastic().displacement(at).y;
        ASSERT_LT(std::abs(now), std::abs(before) + 2e-6) << calls;
        before = now;
    }
    EXPECT_GT(calls, static_cast<int>(volume::relaxationTimes[0] / period));
    EXPECT_LT(calls, 4000);
    EXPECT_EQ(led.elastic().displacement(at), Vec3(0.0));
}

// Where windows lie next to nothing depends on: led across a body that they cover only in part, a ball feels the same as on
// windows that cover all of it.
TEST(Relaxation, WindowsThatMoveTakeTheHistoryAlong)
{
    const Weights weights{0.5F, 0.3F};
    const tests::ElasticBlock block{{46, 16, 30},
                                    cellSpacing,
                                    [=](Index3 c) { return relaxing(relaxingModulus, 0.45, weights, c.y == 15); },
                                    4,
                                    Vec3(0.0)};
    const ElasticBody body = tests::bodyOf(block, 0.4999, true);
    const Vec3 start(30e-3, 0.0, 30e-3);
    const auto forces = [&](int window, int& moves) {
        Elastic elastic(body, ofStrain(true, window), tests::focusUnder(start));
        constexpr double radius = 6e-3, depth = 3e-3;
        std::vector<double> out;
        for (int i = 0; i < 1000; ++i) {
            // In, held for 0.3 s, across at 30 mm/s and back, held.
            const double t = i * period;
            const double deep = depth * std::min(1.0, t / 0.2);
            const double aside = 30e-3 * std::clamp(t < 1.1 ? t - 0.5 : 1.7 - t, 0.0, 0.6);
            const Vec3 at = start + Vec3(aside, 0.0, 0.0);
            std::array tools{tests::ball(at + Vec3(0.0, deep - radius, 0.0), radius, 1e4)};
            tools[0].pushed = Vec3(0.0, deep, 0.0);
            moves += elastic.relax(tests::loadOf(tools, {}, at), 4, 1e-3).moved ? 1 : 0;
            out.push_back(-elastic.toolForce(0).y);
        }
        return out;
    };
    int moves = 0, none = 0;
    const std::vector<double> moving = forces(11, moves), whole = forces(41, none);
    EXPECT_GT(moves, 8);
    EXPECT_EQ(none, 0);
    const double most = *std::ranges::max_element(whole);
    double worst = 0.0;
    for (std::size_t i = 0; i < whole.size(); ++i) {
        worst = std::max(worst, std::abs(moving[i] - whole[i]));
    }
    EXPECT_LT(worst, 0.03 * most);
}

// The history is a force. When windows move, its work along any displacement that is linear in space is what it was.
TEST(Relaxation, WindowsThatMoveKeepTheWorkOfTheHistory)
{
    const tests::ElasticBlock block{{60, 30, 60},
                                    cellSpacing,
                                    [](Index3) {
                                        return relaxing(relaxingModulus, 0.45, {0.5F, 0.3F});
                                    },
                                    1,
                                    Vec3(0.0)};
    const ElasticBody body = tests::bodyOf(block, 0.4999, true);
    const Vec3 middle(60e-3, 30e-3, 60e-3);
    WindowStack stack(body, 11, tests::focusAt(middle));
    std::minstd_rand random(5);
    std::uniform_real_distribution<double> value(-1.0, 1.0);
    const auto inside = [&](Vec3 rest) {
        return glm::all(glm::lessThan(glm::abs(rest - middle), Vec3(40e-3, 20e-3, 40e-3)));
    };
    tests::forEachNode(stack, [&](std::size_t, Window& w, std::size_t node, Vec3 rest) {
        const Vec3 v(value(random), value(random), value(random));
        tests::setAt(w, node, Field::h1, inside(rest) ? static_cast<double>(w.dof[node]) * v : Vec3(0.0));
    });
    const glm::dmat3 slope(value(random), value(random), value(random), value(random), value(random), value(random),
                           value(random), value(random), value(random));
    const auto work = [&] {
        tests::setField(stack, Field::p, [&](Vec3 rest) { return 50.0 * slope * (rest - middle) + Vec3(1, 2, 3); });
        return stack.dot(Field::h1, Field::p);
    };
    const double before = work();
    EXPECT_GT(std::abs(before), 1.0);
    for (const Vec3 to : {Vec3(8e-3, 0, 0), Vec3(8e-3, 4e-3, -6e-3), Vec3(-20e-3, 0, 10e-3), Vec3(0.0)}) {
        ASSERT_TRUE(stack.follow(tests::focusAt(middle + to), true));
        EXPECT_NEAR(work(), before, 1e-4 * std::abs(before));
    }
}

}  // namespace
}  // namespace palpate::chainmail
