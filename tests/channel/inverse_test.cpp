#include <channel/inverse.h>

#include <gtest/gtest.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

namespace palpate::channel {
namespace {

constexpr float halfVoxel = 0.25F;  // display voxels are half a spacing wide [spacings]
constexpr int side = 28;

// Displacements on a lattice whose unit is a metre; they fade to zero at its border, as those of a body in air do.
struct Field {
    explicit Field(const std::function<glm::vec3(glm::vec3)>& of)
    {
        for (std::uint32_t i = 0; i < side * side * side; ++i) {
            const glm::vec3 rest(i % side, i / side % side, i / side / side);
            const glm::vec3 inside = glm::clamp((glm::min(rest, glm::vec3(side - 1) - rest) - 1.0F) / 4.0F, 0.0F, 1.0F);
            const glm::vec3 shown = of(rest) * (inside.x * inside.y * inside.z);
            u[i] = glm::vec4(shown, 1);
            if (shown != glm::vec3(0))
                moved.push_back(i);
        }
        inverse.update(u, moved);
    }
    glm::vec3 seen(glm::vec3 rest) const { return rest + inverse.displacement(rest); }

    std::vector<glm::vec4> u = std::vector<glm::vec4>(side * side * side);
    std::vector<std::uint32_t> moved;
    Inverse inverse{glm::ivec3(side), 1.0F};
};

const glm::vec3 middle(13.3F, 13.7F, 13.1F);

// The skin pressed in by `depth` over a width of `wide`.
Field dimple(float depth, float wide)
{
    return Field([=](glm::vec3 p) {
        const float r = glm::length(glm::vec2(p) - glm::vec2(middle)) / wide;
        return glm::vec3(0, 0, depth * std::exp(-r * r) * std::exp(-std::abs(p.z - 9) / 7));
    });
}

// A needle along z that takes the nodes at its shaft with it by `drag`; their neighbours stay.
Field dragged(float drag)
{
    return Field([=](glm::vec3 p) {
        const float r = glm::length(glm::vec2(p) - glm::vec2(middle));
        return r < 1.5F && p.z < 16 ? glm::vec3(0, 0, drag * (1 - r / 1.5F)) : glm::vec3(0);
    });
}

// Waves in all directions, of the amplitude `size`.
Field waves(unsigned seed, float size)
{
    std::mt19937 random(seed);
    std::normal_distribution<float> normal;
    std::vector<glm::vec3> along, across;
    std::vector<float> phase;
    for (int k = 0; k < 6; ++k) {
        const float x = normal(random), y = normal(random), z = normal(random);
        along.emplace_back(0.5F * glm::vec3(x, y, z));
        const float a = normal(random), b = normal(random), c = normal(random);
        across.emplace_back(size * glm::vec3(a, b, c));
        phase.push_back(3 * normal(random));
    }
    return Field([=](glm::vec3 p) {
        glm::vec3 sum(0);
        for (std::size_t k = 0; k < along.size(); ++k)
            sum += across[k] * std::sin(glm::dot(along[k], p) + phase[k]);
        return sum;
    });
}

struct Errors {
    float place = 0;     // from X to the answer, where tissue lies over itself nowhere
    float residual = 0;  // from x to where the answer is seen
    float start = 0;     // between answers from different starts
};

// Maps random places forward and back, each time from another start.
Errors errorsOf(const Field& field, unsigned seed, int points)
{
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> place(2, side - 3), start(-6, 6);
    Errors errors;
    for (int i = 0; i < points; ++i) {
        const float a = place(random), b = place(random), c = place(random);
        const glm::vec3 rest(a, b, c), x = field.seen(rest);
        const float d = start(random), e = start(random), f = start(random);
        glm::vec3 shift(d, e, f), other(0);
        field.inverse.follow(x, shift);
        field.inverse.follow(x, other);
        errors.place = std::max(errors.place, glm::distance(x + shift, rest));
        errors.residual = std::max(errors.residual, glm::distance(field.seen(x + shift), x));
        errors.start = std::max(errors.start, glm::distance(shift, other));
    }
    return errors;
}

void expectInverse(const Field& field, unsigned seed, int points = 20000)
{
    const Errors errors = errorsOf(field, seed, points);
    EXPECT_LT(errors.residual, 0.03F);
    EXPECT_LT(errors.start, halfVoxel);
    if (field.inverse.folds() == 0) {
        EXPECT_LT(errors.place, halfVoxel);
    }
}

TEST(Inverse, UndoesDimples)
{
    for (const float depth : {1.0F, 3.0F, 6.0F, 9.0F})
        for (const float wide : {2.0F, 4.0F})
            expectInverse(dimple(depth, wide), 1);
    EXPECT_EQ(dimple(3, 4).inverse.folds(), 0U);
}

// Displacements that change by several spacings from one node to the next: fixed-point steps never settle there.
TEST(Inverse, UndoesTheDragOfANeedle)
{
    for (const float drag : {0.8F, -0.8F, 2.0F, -2.0F, 5.0F, -5.0F})
        expectInverse(dragged(drag), 2);
}

// What another process has written wrongly costs no memory.
TEST(Inverse, ANodeThatIsFarAwayIsSearchedWithoutAnIndex)
{
    for (const float far : {2e3F, 5e4F}) {
        const Field field([=](glm::vec3 p) { return p == glm::vec3(13) ? glm::vec3(far, -far, far) : glm::vec3(0); });
        EXPECT_GT(field.inverse.folds(), 0U);
        glm::vec3 shift(0);
        field.inverse.follow(glm::vec3(3), shift);
        EXPECT_LT(glm::length(shift), halfVoxel);
    }
}

TEST(Inverse, UndoesRandomDeformations)
{
    int folded = 0;
    for (unsigned seed = 1; seed <= 6; ++seed)
        for (const float size : {0.2F, 0.6F, 1.2F}) {
            const Field field = waves(seed, size);
            folded += field.inverse.folds() > 0;
            expectInverse(field, seed, 2000);
        }
    EXPECT_GT(folded, 3) << "some of them fold";
    EXPECT_LT(folded, 16) << "and some do not";
}

// What a slice does: rows of pixels, each from where the last pixel ended. Neighbours in a row and across rows are as near
// at rest as the least stretch allows: pixels 0.1 spacings apart, stretched to a tenth at least.
TEST(Inverse, IsContinuousAlongAndAcrossRows)
{
    for (const Field& field : {dimple(3, 4), dragged(0.8F), waves(3, 0.2F)}) {
        ASSERT_EQ(field.inverse.folds(), 0U);
        constexpr int pixels = 200;
        std::vector<glm::vec3> before, row(pixels);
        for (int r = 0; r < pixels; ++r) {
            glm::vec3 shift(0);
            for (int c = 0; c < pixels; ++c) {
                const glm::vec3 x(4 + 0.1F * static_cast<float>(c), 13.4F, 4 + 0.1F * static_cast<float>(r));
                field.inverse.follow(x, shift);
                row[static_cast<std::size_t>(c)] = x + shift;
            }
            for (std::size_t c = 1; c < row.size(); ++c) {
                ASSERT_LT(glm::distance(row[c], row[c - 1]), 1.0F) << r << " " << c;
                ASSERT_TRUE(before.empty() || glm::distance(row[c], before[c]) < 1.0F) << r << " " << c;
            }
            before = row;
        }
    }
}

// Nothing moved: nothing is looked for, whatever the start.
TEST(Inverse, IsNothingAtRest)
{
    const Field field([](glm::vec3) { return glm::vec3(0); });
    glm::vec3 shift(3, -2, 1);
    field.inverse.follow({9.5F, 8.25F, 7}, shift);
    EXPECT_LT(glm::length(shift), 1e-6F);
}

}  // namespace
}  // namespace palpate::channel
