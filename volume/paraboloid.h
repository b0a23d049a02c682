#pragma once

#include <volume/blurred_surface.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

// Inside volume/ only.
namespace palpate::volume {

// Four numbers at once, in a register of any processor: the same bits on each.
using Four = float __attribute__((vector_size(16)));
using FourMasks = std::int32_t __attribute__((vector_size(16)));  // -1 is true, 0 false

// Points of a surface, coordinate by coordinate, so that four are read at once. Behind the last there is room for three
// more.
struct PointColumns {
    std::vector<float> x, y, z;     // places
    std::vector<float> nx, ny, nz;  // normals

    explicit PointColumns(std::size_t count = 0)
    {
        for (std::vector<float>* column : {&x, &y, &z, &nx, &ny, &nz}) {
            column->resize(count + 3);
        }
    }
    void set(std::size_t k, const SurfacePoint& point)
    {
        x[k] = point.at.x, y[k] = point.at.y, z[k] = point.at.z;
        nx[k] = point.normal.x, ny[k] = point.normal.y, nz[k] = point.normal.z;
    }
};

// Height over a plane, a + b u + c v + d u^2 + e u v + f v^2, by weighted least squares.
class Paraboloid {
public:
    Paraboloid(const SurfacePoint& top, float reach) : origin_(top.at), normal_(top.normal), reach_(reach)
    {
        const Vec3f other = std::abs(normal_.x) < 0.7F ? Vec3f(1, 0, 0) : Vec3f(0, 1, 0);
        u_ = glm::normalize(glm::cross(normal_, other));
        v_ = glm::cross(normal_, u_);
    }

    // Adds those of the points from `first` to `end` that are within reach and may lie on the same sheet of the surface: a
    // layer below or above has the same normals.
    void add(const PointColumns& points, std::size_t first, std::size_t end)
    {
        for (std::size_t k = first; k < end; k += 4) {
            addFour(points, k, static_cast<std::int32_t>(std::min<std::size_t>(end - k, 4)));
        }
    }

    // By Cholesky's factors. False where the points do not tell.
    bool solve()
    {
        constexpr int fewest = 10;
        constexpr double leastPivot = 0.05;
        if (-(count_[0] + count_[1] + count_[2] + count_[3]) < fewest) {
            return false;
        }
        for (std::size_t i = 0; i < 6; ++i) {
            right_[i] = sum(heights_[degreeU[i]][degreeV[i]]);
            for (std::size_t j = 0; j <= i; ++j) {
                matrix_[i][j] = sum(moments_[degreeU[i] + degreeU[j]][degreeV[i] + degreeV[j]]);
            }
        }
        for (std::size_t i = 0; i < 6; ++i) {
            for (std::size_t j = 0; j <= i; ++j) {
                double sum = matrix_[i][j];
                for (std::size_t k = 0; k < j; ++k) {
                    sum -= matrix_[i][k] * matrix_[j][k];
                }
                if (i == j && sum < leastPivot * leastPivot * matrix_[0][0]) {
                    return false;
                }
                matrix_[i][j] = i == j ? std::sqrt(sum) : sum / matrix_[j][j];
            }
        }
        for (std::size_t i = 0; i < 6; ++i) {
            for (std::size_t k = 0; k < i; ++k) {
                right_[i] -= matrix_[i][k] * right_[k];
            }
            right_[i] /= matrix_[i][i];
        }
        for (std::size_t i = 6; i-- > 0;) {
            for (std::size_t k = i + 1; k < 6; ++k) {
                right_[i] -= matrix_[k][i] * right_[k];
            }
            right_[i] /= matrix_[i][i];
        }
        return true;
    }

    float height() const { return static_cast<float>(right_[0]) * reach_; }
    // Sum of the second derivatives: negative where the structure is convex.
    float bend() const { return static_cast<float>(2.0 * (right_[3] + right_[5])) / reach_; }
    Vec3f normal() const
    {
        return glm::normalize(normal_ - static_cast<float>(right_[1]) * u_ - static_cast<float>(right_[2]) * v_);
    }

    static constexpr float unlike = 0.2F;  // 1 less the cosine between normals from which on a point does not count

private:
    static constexpr float slope = 0.3F;  // of the height that a point may have, with its distance
    static constexpr float level = 0.5F;  // height that points beside the origin may have [spacings]
    // u and v in the terms of the height.
    static constexpr std::array<std::size_t, 6> degreeU{0, 1, 0, 2, 1, 0};
    static constexpr std::array<std::size_t, 6> degreeV{0, 0, 1, 0, 1, 2};

    static Four load(const std::vector<float>& column, std::size_t k)
    {
        Four four;
        std::memcpy(&four, column.data() + k, sizeof four);
        return four;
    }
    static bool any(FourMasks masks)
    {
        using Two = std::int64_t __attribute__((vector_size(16)));
        const Two two = std::bit_cast<Two>(masks);
        return (two[0] | two[1]) != 0;
    }
    static double sum(Four four)
    {
        return (static_cast<double>(four[0]) + static_cast<double>(four[1])) +
               (static_cast<double>(four[2]) + static_cast<double>(four[3]));
    }

    // Of points k to k + 3 the first `count`.
    void addFour(const PointColumns& points, std::size_t k, std::int32_t count)
    {
        const float scale = 1.0F / reach_;
        const Four x = scale * (load(points.x, k) - origin_.x);
        const Four y = scale * (load(points.y, k) - origin_.y);
        const Four z = scale * (load(points.z, k) - origin_.z);
        const Four far = x * x + y * y + z * z;
        FourMasks taken = (far < 1.0F) & (FourMasks{0, 1, 2, 3} < count);
        if (!any(taken)) {
            return;
        }
        const Four w = x * normal_.x + y * normal_.y + z * normal_.z;
        const Four above = (w < 0.0F ? -w : w) - scale * level;
        const Four likeness =
            1.0F -
            (1.0F - (load(points.nx, k) * normal_.x + load(points.ny, k) * normal_.y + load(points.nz, k) * normal_.z)) /
                unlike;
        taken &= (likeness > 0.0F) & ((above <= 0.0F) | (above * above <= slope * slope * far));
        count_ += taken;
        const Four near = (1.0F - far) * likeness;
        const Four weight = taken ? near * near : Four{};
        addTo(weight, x * u_.x + y * u_.y + z * u_.z, x * v_.x + y * v_.y + z * v_.z, w);
    }

    void addTo(Four weight, Four u, Four v, Four w)
    {
        Four power = weight;  // times u^i
#pragma GCC unroll 5
        for (std::size_t i = 0; i <= 4; ++i, power *= u) {
            Four moment = power;  // times v^j
#pragma GCC unroll 5
            for (std::size_t j = 0; j <= 4 - i; ++j, moment *= v) {
                moments_[i][j] += moment;
                if (i + j <= 2) {
                    heights_[i][j] += moment * w;
                }
            }
        }
    }

    Vec3f origin_, normal_, u_, v_;
    float reach_;
    std::array<std::array<Four, 5>, 5> moments_{};   // sums of weight u^i v^j
    std::array<std::array<Four, 3>, 3> heights_{};   // of weight w u^i v^j
    FourMasks count_{};                              // less the number of points
    std::array<std::array<double, 6>, 6> matrix_{};  // lower triangle
    std::array<double, 6> right_{};
};

}  // namespace palpate::volume
