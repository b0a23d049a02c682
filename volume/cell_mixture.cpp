#include <volume/cell_mixture.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::volume {

void CellMixture::Sums::add(double weight, double modulus, Vec3 at) noexcept
{
    fraction += weight;
    stiffness += weight * modulus;
    compliance += weight / modulus;
    place += weight * at;
    stiffest += weight * modulus * at;
    square += weight * modulus * modulus;
    softest = std::min(softest, modulus);
}

double CellMixture::Sums::arithmetic() const noexcept
{
    return stiffness / fraction;
}

double CellMixture::Sums::mean() const noexcept
{
    return std::sqrt(stiffness / compliance);
}

std::pair<Vec3, double> CellMixture::Sums::layer() const noexcept
{
    const double more = stiffness - fraction * softest;
    if (!(more > 1e-6 * stiffness)) {
        return {Vec3(0.0), 0.0};
    }
    const double squares = square - 2.0 * softest * stiffness + softest * softest * fraction;
    return {(stiffest - softest * place) / more, std::min(more * more / (squares * fraction), 1.0)};
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
    const auto [middle, share] = free_.layer();
    const double rigid = held_.fraction > 0.0 ? held_.mean() : std::numeric_limits<double>::infinity();
    const double modulus = free_.fraction > 0.0 ? std::min(free_.mean() * tissue / free_.fraction, rigid) : rigid;
    CellMaterial material{static_cast<float>(tissue * modulus),
                          static_cast<float>(poisson_ / tissue),
                          static_cast<float>(tissue),
                          static_cast<float>(held_.fraction / tissue),
                          static_cast<float>(stiffening_.mean()),
                          {},
                          free_.fraction > 0.0 ? static_cast<float>(free_.arithmetic() / free_.mean()) : 1.0F,
                          Vec3f(middle),
                          static_cast<float>(share)};
    for (std::size_t i = 0; i < relaxing_.size() && free_.fraction > 0.0; ++i) {
        material.relaxing[i] = static_cast<float>(relaxing_[i] / free_.fraction);
    }
    return material;
}

}  // namespace palpate::volume
