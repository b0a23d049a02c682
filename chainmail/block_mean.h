#pragma once

#include <chainmail/cell_levels.h>
#include <chainmail/fragments.h>
#include <volume/cell_mixture.h>
#include <volume/relaxation.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace palpate::chainmail {

/// Of a coarse cell, or of a fragment of one.
struct Moduli {
    double mu = 0;
    double bulk = 0;
    double stiffening = 0;
    double held = 0;                                         // fraction of the tissue
    std::array<double, volume::relaxationTerms> relaxing{};  // weights
};

/// Energy and not volume decides: under the same strain cells side by side add their stiffness, under the same stress they
/// add their compliance. Inside the body a block of eight is between the two: the geometric mean of both bounds keeps thin
/// stiff layers stiff and thin gaps soft. Layers under a free surface bear no stress across, and along it they have the
/// strain of the surface: their stiffness adds, as in a laminate. What is held in space gives way in neither: it leaves
/// less of the block to be strained, and the rest of it by as much more. Sources: W. Voigt 1889 and A. Reuss 1929 (bounds);
/// the mean as in docs/decisions.md, 8.
class BlockMean {
public:
    /// @param held  fraction of the cell's tissue that is held
    void add(double modulus, double held)
    {
        ++filled_;
        whole_ += modulus;
        const double free = 1.0 - held;
        if (free > 1.0 - static_cast<double>(whollyHeld)) {
            free_ += free;
            sum_ += free * free * modulus;
            inverse_ += 1.0 / modulus;
        }
    }
    double modulus(bool atSurface) const
    {
        if (filled_ == 0) {
            return 0.0;
        }
        const double fraction = filled_ / 8.0;
        if (free_ <= 0.0) {
            return whole_ / filled_ * fraction;
        }
        const double mean = atSurface ? sum_ / free_ : std::sqrt(sum_ / inverse_);
        return mean * filled_ / free_ * fraction;
    }

private:
    int filled_ = 0;
    double whole_ = 0.0;
    double free_ = 0.0;  // cells
    double sum_ = 0.0;   // of moduli without what is held, by share
    double inverse_ = 0.0;
};

/// What a coarse cell, or a fragment of one, has of its cells' materials: the shear modulus of its cells right after a
/// step, and that of a long time after it; the terms share what is gone as they do on average.
class BlockSums {
public:
    void add(const CellFragment& cell)
    {
        const double m = static_cast<double>(cell.mu), held = static_cast<double>(cell.held);
        mu_.add(m, held);
        bulk_.add(static_cast<double>(cell.lambda) + 2.0 / 3.0 * m, held);
        stiffening_.add(1.0, m, static_cast<double>(cell.stiffening));
        mean_.held += held;
        double left = 1.0;
        for (std::size_t i = 0; i < mean_.relaxing.size(); ++i) {
            const double weight = static_cast<double>(cell.relaxing[i]);
            mean_.relaxing[i] += m * weight;
            left -= weight;
        }
        relaxed_.add(m * left, held);
        ++filled_;
    }
    Moduli moduli(bool surface) const
    {
        const double sum = std::accumulate(mean_.relaxing.begin(), mean_.relaxing.end(), 0.0);
        const double gone = sum > 0.0 ? 1.0 - relaxed_.modulus(surface) / mu_.modulus(surface) : 0.0;
        std::array<double, volume::relaxationTerms> relaxing = mean_.relaxing;
        for (double& weight : relaxing) {
            weight *= sum > 0.0 ? gone / sum : 0.0;
        }
        return {mu_.modulus(surface), bulk_.modulus(surface), stiffening_.mean(), mean_.held / std::max(filled_, 1),
                relaxing};
    }

private:
    BlockMean mu_, bulk_, relaxed_;
    volume::StiffeningMean stiffening_;
    Moduli mean_;
    int filled_ = 0;
};

}  // namespace palpate::chainmail
