#include <volume/cell_mixture.h>

#include <Eigen/Eigenvalues>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::volume {

void CellMixture::Sums::add(double weight, double modulus, Vec3 at) noexcept
{
    fraction += weight;
    stiffness += weight * modulus;
    compliance += weight / modulus;
    byWeight.add(weight, at);
    byStiffness.add(weight * modulus, at);
    square += weight * modulus * modulus;
    softest = std::min(softest, modulus);
    stiffest = std::max(stiffest, modulus);
}

void CellMixture::Places::add(double weight, Vec3 at) noexcept
{
    first += weight * at;
    second += weight * glm::outerProduct(at, at);
}

double CellMixture::Sums::arithmetic() const noexcept
{
    return stiffness / fraction;
}

double CellMixture::Sums::mean() const noexcept
{
    return std::sqrt(stiffness / compliance);
}

CellMixture::Layer CellMixture::Sums::layer() const noexcept
{
    const double more = stiffness - fraction * softest;
    if (!(more > 1e-6 * stiffness)) {
        return {};
    }
    const double squares = square - 2.0 * softest * stiffness + softest * softest * fraction;
    const double share = std::min(more * more / (squares * fraction), 1.0);
    const Places stiff = byStiffness.minus(byWeight.times(softest)).times(1.0 / more);
    if (share <= 0.5) {
        return {stiff.first, normalOf(stiff), share};
    }
    const double less = fraction * stiffest - stiffness;
    return {stiff.first, normalOf(byWeight.times(stiffest).minus(byStiffness).times(1.0 / less)), share};
}

// A part is off the cell's middle along a layer's normal, and thin along it. Of a layer as wide as the cell, t of it thick
// and m off its middle, the difference of the largest value from the next is m^2 + (1 - t^2) / 3.
Vec3 CellMixture::normalOf(const Places& part) noexcept
{
    constexpr double least = 0.2;  // of that; between tissues that lie in no layers there is no normal
    const Mat3 off = 2.0 * glm::outerProduct(part.first, part.first) - part.second;
    Eigen::Matrix3d matrix;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            matrix(i, j) = off[i][j];
        }
    }
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
    axes.computeDirect(matrix);
    const Eigen::Vector3d values = axes.eigenvalues(), normal = axes.eigenvectors().col(2);
    return values(2) - values(1) >= least ? Vec3(normal(0), normal(1), normal(2)) : Vec3(0.0);
}

void CellMixture::add(const TissueRow& row, double weight, double scale, bool held, Vec3 place) noexcept
{
    (held ? held_ : free_).add(weight, row.youngsModulus * scale, place);
    poisson_ += weight * row.poissonRatio;
    stiffening_.add(weight, row.youngsModulus * scale, row.stiffening);
    for (std::size_t i = 0; i < relaxing_.size() && !held; ++i) {
        relaxing_[i] += weight * row.relaxation().weights[i];
    }
}

CellMaterial CellMixture::material() const noexcept
{
    const double tissue = fraction();
    if (tissue <= 0.0) {
        return {};
    }
    const Layer layer = free_.layer();
    const double rigid = held_.fraction > 0.0 ? held_.mean() : std::numeric_limits<double>::infinity();
    const double modulus = free_.fraction > 0.0 ? std::min(free_.mean() * tissue / free_.fraction, rigid) : rigid;
    CellMaterial material{static_cast<float>(tissue * modulus),
                          static_cast<float>(poisson_ / tissue),
                          static_cast<float>(tissue),
                          static_cast<float>(held_.fraction / tissue),
                          static_cast<float>(stiffening_.mean()),
                          {},
                          free_.fraction > 0.0 ? static_cast<float>(free_.arithmetic() / free_.mean()) : 1.0F,
                          Vec3f(layer.middle),
                          static_cast<float>(layer.share),
                          Vec3f(layer.normal)};
    if (held_.fraction > 0.0) {
        material.held.middle = Vec3f(held_.byWeight.first / held_.fraction);
    }
    for (std::size_t i = 0; i < relaxing_.size() && free_.fraction > 0.0; ++i) {
        material.relaxing[i] = static_cast<float>(relaxing_[i] / free_.fraction);
    }
    return material;
}

}  // namespace palpate::volume
