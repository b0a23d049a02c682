#pragma once

#include <volume/blurred_surface.h>

#include <glm/geometric.hpp>

#include <array>
#include <cmath>
#include <cstddef>

// Inside volume/ only.
namespace palpate::volume {

// Height over a plane, a + b u + c v + d u^2 + e u v + f v^2, by weighted least squares.
class Paraboloid {
public:
    Paraboloid(const SurfacePoint& top, float reach)
        : origin_(top.at), normal_(top.normal), reach_(reach), level_(0.5F / reach), beyond_(1.00001F * reach * reach)
    {
        const Vec3f other = std::abs(normal_.x) < 0.7F ? Vec3f(1, 0, 0) : Vec3f(0, 1, 0);
        u_ = glm::normalize(glm::cross(normal_, other));
        v_ = glm::cross(normal_, u_);
    }

    bool isNearAlongX(float x) const { return std::abs(x - origin_.x) < reach_; }

    // A point, if it is within reach and may lie on the same sheet of the surface: a layer below or above has the same
    // normals.
    void add(const SurfacePoint& point)
    {
        constexpr float slope = 0.3F;  // of the height that a point may have, with its distance
        const Vec3f steps = point.at - origin_;
        if (glm::dot(steps, steps) > beyond_) {
            return;
        }
        const Vec3f way = steps / reach_;
        const float far = glm::dot(way, way);
        if (far >= 1.0F || std::abs(glm::dot(way, normal_)) > level_ + slope * std::sqrt(far)) {
            return;
        }
        const float likeness = 1.0F - (1.0F - glm::dot(point.normal, normal_)) / unlike;
        if (likeness <= 0.0F) {
            return;
        }
        const double weight = static_cast<double>((1.0F - far) * (1.0F - far) * likeness * likeness);
        const double u = glm::dot(way, u_);
        const double v = glm::dot(way, v_);
        const double w = glm::dot(way, normal_);
        const std::array<Pair, 4> row{Pair{w, 1.0}, Pair{u, v}, Pair{u * u, u * v}, Pair{v * v, 0.0}};
        addRow<0>(weight, row);
        addRow<1>(weight * u, row);
        addRow<2>(weight * v, row);
        addRow<3>(weight * (u * u), row);
        addRow<4>(weight * (u * v), row);
        addRow<5>(weight * (v * v), row);
        ++count_;
    }

    // By Cholesky's factors. False where the points do not tell.
    bool solve()
    {
        constexpr int fewest = 10;
        constexpr double leastPivot = 0.05;
        if (count_ < fewest) {
            return false;
        }
        for (std::size_t i = 0; i < 6; ++i) {
            right_[i] = sums_[i][0][0];
            for (std::size_t j = 0; j <= i; ++j) {
                matrix_[i][j] = sums_[i][(j + 1) / 2][(j + 1) % 2];
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
    using Pair = double __attribute__((vector_size(16)));  // two numbers in a register of any processor

    // Adds to row `i` of the normal equations: the right side, then the lower triangle.
    template <std::size_t i>
    void addRow(double factor, const std::array<Pair, 4>& row)
    {
#pragma GCC unroll 4
        for (std::size_t k = 0; k <= (i + 1) / 2; ++k) {
            sums_[i][k] += factor * row[k];
        }
    }

    Vec3f origin_, normal_, u_, v_;
    float reach_;
    float level_;   // height that points beside the origin may have, over reach
    float beyond_;  // square of a distance that is beyond reach, whatever the rounding
    std::array<std::array<Pair, 4>, 6> sums_{};
    std::array<std::array<double, 6>, 6> matrix_{};  // lower triangle
    std::array<double, 6> right_{};
    int count_ = 0;
};

}  // namespace palpate::volume
