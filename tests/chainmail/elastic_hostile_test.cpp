#include "elastic_bodies.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace palpate::chainmail {
namespace {

bool isFinite(Vec3 v)
{
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

bool allFinite(const Elastic& elastic)
{
    for (const Window& w : elastic.stack().windows()) {
        for (const Field f : {Field::u, Field::a, Field::d, Field::e, Field::p, Field::q}) {
            const float* v = w.field(f);
            if (!std::all_of(v, v + 3 * w.layout.count, [](float x) { return std::isfinite(x); })) {
                return false;
            }
        }
    }
    return true;
}

// A hand that wants to break things: it jumps, turns back, presses through the block, drags aside, goes away, and ties
// material points down with springs of any stiffness, none included.
class HostileHand {
public:
    explicit HostileHand(Vec3 size) : size_(size) {}

    void next()
    {
        switch (random_() % 8) {
            case 0:  // anywhere, outside too
                at_ = size_ * (2.0 * Vec3(unit(), unit(), unit()) - 0.5);
                break;
            case 1:  // far away
                at_ = Vec3(unit(), unit(), unit()) - 0.5;
                break;
            case 2:  // deep
                at_.y += 8e-3 * unit();
                break;
            case 3:  // back
                step_ = -step_;
                [[fallthrough]];
            case 4:  // aside
                at_ += step_;
                break;
            case 5:
                step_ = 4e-3 * (Vec3(unit(), unit(), unit()) - 0.5);
                [[fallthrough]];
            default:
                at_ += 0.25 * step_;
        }
        tools_[0] = tests::ball(at_, 5e-3 * unit(), std::pow(10.0, 6.0 * unit()));
        const Vec3 end = at_ + 20e-3 * (Vec3(unit(), unit(), unit()) - 0.5);
        tools_[1].shape = {at_, end, 4e-3 * unit(), 4e-3 * unit()};
        tools_[1].pushed = step_;
        toolCount_ = random_() % 3;
        tieCount_ = random_() % 3;
        for (Tie& tie : ties_) {
            const double along = random_() % 4 == 0 ? 0.0 : std::pow(10.0, 5.0 * unit());
            const double across = random_() % 4 == 0 ? 0.0 : std::pow(10.0, 5.0 * unit());
            const Vec3 axis = glm::normalize(Vec3(unit(), unit(), unit()) + 0.01);
            tie = {size_ * (1.4 * Vec3(unit(), unit(), unit()) - 0.2), 10e-3 * (Vec3(unit(), unit(), unit()) - 0.5), axis,
                   along, across};
        }
    }

    ElasticLoad load() const
    {
        return tests::loadOf(std::span(tools_).first(toolCount_), std::span(ties_).first(tieCount_), at_);
    }
    std::size_t tools() const { return toolCount_; }
    std::size_t ties() const { return tieCount_; }
    std::size_t random() { return random_(); }

private:
    double unit() { return value_(random_); }

    Vec3 size_;
    Vec3 at_{0.0};
    Vec3 step_{1e-3};
    std::array<ElasticTool, 2> tools_;
    std::array<Tie, 2> ties_;
    std::size_t toolCount_ = 0, tieCount_ = 0;
    std::minstd_rand random_{11};
    std::uniform_real_distribution<double> value_{0.0, 1.0};
};

// What the energy is, and not what was carried on: that of the tissue where its windows are, and that of the contacts.
double trueEnergy(const Elastic& elastic, const volume::Law& law)
{
    WindowStack stack = elastic.stack();
    double sum = stack.evaluate(Field::u, Field::f, Field::u, law).energy;
    for (const ContactSite& s : elastic.sites()) {
        sum += s.energy;
    }
    return sum;
}

// Calls at a load that stands still, after `last`. At small strain none raises the energy. At finite strain a step is
// carried on along a parabola, and under springs that jump that may be far off: the energy is evaluated anew here, and what
// raised it is counted. Tissue that relaxes is left out there: its history does not turn with it, and springs of 100 kN/m
// that let go leave it in cells that it turns inside out.
// @returns  how many of four calls raised the energy
int standStill(Elastic& elastic, const ElasticLoad& load, const volume::Law& law, ElasticResult last, double peak)
{
    int rises = 0;
    for (int again = 0; again < 4; ++again) {
        if (volume::isSmall(law)) {
            const auto result = elastic.relax(load);
            EXPECT_LE(result.energy, result.start + 1e-5 * peak + 1e-15) << "again " << again;
        } else if (elastic.body().relaxes) {
            elastic.relax(load);
        } else {
            const double off = trueEnergy(elastic, law) - last.energy;
            last = elastic.relax(load);
            // Where the call has begun with forces anew, its start is the true one.
            rises += trueEnergy(elastic, law) > last.start + std::max(off, 0.0) + 1e-4 * peak + 1e-15 ? 1 : 0;
        }
    }
    return rises;
}

// What raised the energy, of the calls at loads that stand still.
struct Rises {
    int calls = 0, rises = 0;

    // At finite strain single calls do: of 40 such hands 1 in 3,600, up to 1 in 560 with b = 100 and neo-hookean. The bound
    // is over all bodies of a test, so that chance does not meet it.
    void expectFew() const { EXPECT_LE(rises, 1 + calls / 500) << "of " << calls; }
};

// Every number stays finite. Counts into `counted`.
void push(const ElasticBody& body, Vec3 size, const volume::Law& law, int pushes, Rises& counted)
{
    ElasticOptions options;
    options.window = 9;
    options.law = law;
    options.period = 20e-3;
    Elastic elastic(body, options, tests::focusAt(0.5 * size));
    HostileHand hand(size);
    int contacts = 0;
    double peak = 0.0;  // of the energy since the body was at rest: its sums are rounded to that
    for (int i = 0; i < pushes; ++i) {
        hand.next();
        const auto load = hand.load();
        const auto result = elastic.relax(load);
        contacts += result.contacts > 0 ? 1 : 0;
        peak = elastic.atRest() ? 0.0 : std::max(peak, std::abs(result.energy));
        ASSERT_TRUE(std::isfinite(result.energy) && std::isfinite(result.depth)) << "push " << i;
        for (std::size_t t = 0; t < hand.tools(); ++t) {
            ASSERT_TRUE(isFinite(elastic.toolForce(t))) << "push " << i;
        }
        for (std::size_t t = 0; t < hand.ties(); ++t) {
            ASSERT_TRUE(isFinite(elastic.tieForce(t))) << "push " << i;
        }
        if (hand.random() % 10 == 0) {
            SCOPED_TRACE(fmt::format("push {}", i));
            counted.calls += 4;
            counted.rises += standStill(elastic, load, law, result, peak);
        }
        if (i % 100 == 0) {
            ASSERT_TRUE(allFinite(elastic)) << "push " << i;
        }
    }
    EXPECT_GT(contacts, pushes / 16);
    // Tissue that relaxes has to come back first.
    for (int i = 0; i < 20000 && !elastic.atRest() && body.relaxes; ++i) {
        elastic.relax({});
    }
    elastic.relax({});
    EXPECT_TRUE(elastic.atRest());
}

// The force goes on by Hertz's law from where the tool is held back, F = F(d) (D / d)^(3/2). Friction and relaxation leave
// a force where d comes to nothing, which that law has none for: there it goes on from a tenth of the radius.
TEST(ElasticHostile, AForceAtNoDepthIsNotRaisedBeyondBounds)
{
    const auto body = tests::bodyOf(tests::heldBlock(Index3(24), 1e-3, 5e3, 0.45));
    constexpr double radius = 6e-3, whole = 20e-3;
    ElasticTool tool = tests::ball({0, 0, 0}, radius, 1e4);
    tool.pushed = {0, whole, 0};
    tool.friction = 0.5;
    for (const double given : {0.0, 0.05 * radius, 0.2 * radius, 1.0 * radius}) {
        HeldTool held;
        held.given = given;
        held.stretch = 6.5;  // no further
        held.place(tool, body, false, true);
        EXPECT_EQ(held.given, given);
        held.felt = {0, -1, 0};
        const double from = std::max(given, 0.1 * radius);
        EXPECT_NEAR(glm::length(held.force()), std::pow(1.0 + (whole - given) / from, 1.5), 1e-9) << given;
    }
}

// A rod on its side presses as a cylinder does, in proportion to its depth; on its ends it is a ball. By a ball's law a rod
// of 1 mm, 10 mm deep, had three and a half times its force.
TEST(ElasticHostile, TheForceOfARodOnItsSideGoesOnInProportion)
{
    const auto body = tests::bodyOf(tests::heldBlock(Index3(24), 1e-3, 5e3, 0.45));
    ElasticTool tool = tests::ball({0, 0, 0}, 6e-3, 1e4);
    tool.pushed = {0, 18e-3, 0};
    for (const double onEnds : {0.0, 0.5, 1.0}) {
        HeldTool held;
        held.given = 9e-3;
        held.stretch = 6.5;  // no further
        held.load = 1.0;
        held.onEnds = onEnds;
        held.place(tool, body, false, true);
        held.felt = {0, -1, 0};
        EXPECT_NEAR(glm::length(held.force()), std::pow(2.0, 1.0 + 0.5 * onEnds), 1e-9) << onEnds;
    }
}

TEST(ElasticHostile, TissueThatRelaxesStaysFiniteAndComesBack)
{
    Rises rises;
    auto block = tests::heldBlock({20, 14, 17}, 1e-3, 1e4, 0.45);
    block.material = [](Index3 c) {
        volume::CellMaterial m = tests::tissue(1e4, 0.45, c.y == 13);
        m.relaxing = {0.5F, 0.2F};
        return m;
    };
    const ElasticBody body = tests::bodyOf(block, 0.4999, true);
    for (const volume::Law& law : {volume::Law(volume::SmallStrain{}), volume::Law(volume::NeoHookean{})}) {
        push(body, Vec3(20e-3, 14e-3, 17e-3), law, 3000, rises);
    }
    rises.expectFew();
}

TEST(ElasticHostile, TenThousandPushesStayFiniteAndNeverRaiseTheEnergy)
{
    Rises rises;
    const Vec3 size(20e-3, 14e-3, 17e-3);
    push(tests::bodyOf(tests::heldBlock({20, 14, 17}, 1e-3, 1e4, 0.45)), size, volume::SmallStrain{}, 10000, rises);
    rises.expectFew();
}

TEST(ElasticHostile, FiniteStrainStaysFiniteAndDoesNotRaiseTheEnergy)
{
    Rises rises;
    const Vec3 size(20e-3, 14e-3, 17e-3);
    push(tests::bodyOf(tests::heldBlock({20, 14, 17}, 1e-3, 1e4, 0.45)), size, volume::NeoHookean{}, 1500, rises);
    rises.expectFew();
}

// Tissue that softens, that stiffens as the tissue table's tumours do, and further than the exponential law lets it.
TEST(ElasticHostile, TissueThatStiffensStaysFiniteAndDoesNotRaiseTheEnergy)
{
    Rises rises;
    for (const volume::Law& law : {volume::Law(volume::NeoHookean{}), volume::Law(volume::Exponential{})}) {
        for (const float b : {-0.25F, 7.0F, 18.0F, 100.0F}) {
            auto block = tests::heldBlock({20, 14, 17}, 1e-3, 1e4, 0.45);
            block.material = [b](Index3 c) {
                volume::CellMaterial m = tests::tissue(1e4, 0.45, c.y == 13);
                m.stiffening = b;
                return m;
            };
            SCOPED_TRACE(fmt::format("{}, b = {}", volume::nameOf(law), b));
            push(tests::bodyOf(block), Vec3(20e-3, 14e-3, 17e-3), law, 700, rises);
        }
    }
    rises.expectFew();
}

// Membranes are turned, folded and torn at by the same hand.
TEST(ElasticHostile, SkinThinnerThanACellStaysFiniteAndDoesNotRaiseTheEnergy)
{
    Rises rises;
    auto block = tests::heldBlock({20, 14, 17}, 1e-3, 1e4, 0.45);
    block.material = [](Index3 c) {
        volume::CellMaterial m = tests::tissue(1e4, 0.45, c.y == 13);
        m.relaxing = {0.5F, 0.2F};
        if (c.y == 0) {
            m.along = 3.0F;
            m.share = 0.3F;
            m.middle = {0.0F, -0.7F, 0.0F};
        }
        return m;
    };
    for (const bool relaxes : {false, true}) {
        const ElasticBody body = tests::bodyOf(block, 0.4999, relaxes);
        ASSERT_GT(body.levels.front().layers.size(), 300u);
        for (const volume::Law& law : {volume::Law(volume::SmallStrain{}), volume::Law(volume::NeoHookean{})}) {
            push(body, Vec3(20e-3, 14e-3, 17e-3), law, 900, rises);
        }
    }
    rises.expectFew();
}

}  // namespace
}  // namespace palpate::chainmail
