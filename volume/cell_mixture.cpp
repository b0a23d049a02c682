#include <volume/cell_mixture.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::volume {

void CellMixture::Sums::add(double weight, double modulus) noexcept
{
    fraction += weight;
    stiffness += weight * modulus;
    compliance += weight / modulus;
}

double CellMixture::Sums::arithmetic() const noexcept
{
    return stiffness / fraction;
}

double CellMixture::Sums::mean() const noexcept
{
    return std::sqrt(stiffness / compliance);
}

void CellMixture::add(const TissueRow& row, double weight, double scale, bool held) noexcept
{
    (held ? held_ : free_).add(weight, row.youngsModulus * scale);
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
    const double rigid = held_.fraction > 0.0 ? held_.mean() : std::numeric_limits<double>::infinity();
    const double modulus = free_.fraction > 0.0 ? std::min(free_.mean() * tissue / free_.fraction, rigid) : rigid;
    CellMaterial material{static_cast<float>(tissue * modulus),
                          static_cast<float>(poisson_ / tissue),
                          static_cast<float>(held_.fraction / tissue),
                          static_cast<float>(stiffening_.mean()),
                          {},
                          free_.fraction > 0.0 ? static_cast<float>(free_.arithmetic() / free_.mean()) : 1.0F};
    for (std::size_t i = 0; i < relaxing_.size() && free_.fraction > 0.0; ++i) {
        material.relaxing[i] = static_cast<float>(relaxing_[i] / free_.fraction);
    }
    return material;
}

}  // namespace palpate::volume
