#pragma once

#include <volume/tissue.h>
#include <volume/tissue_table.h>

#include <array>
#include <limits>
#include <utility>

namespace palpate::volume {

/// Stiffening of a cell that several tissues share.
class StiffeningMean {
public:
    /// Parts in series bear the same stress, so that a part's strain goes as 1 / modulus, and the term b mu / 4 I^2 of its
    /// energy as b / modulus^3: the mean of b with these weights, which is between the least and the largest b.
    /// @param weight   fraction of the cell [-]
    /// @param modulus  over 0 [any unit of stress]
    /// @param b        stiffening [-]
    void add(double weight, double modulus, double b) noexcept
    {
        const double share = weight / (modulus * modulus * modulus);
        weight_ += share;
        sum_ += share * b;
    }
    double mean() const noexcept { return weight_ > 0.0 ? sum_ / weight_ : 0.0; }

private:
    double weight_ = 0.0, sum_ = 0.0;
};

/// The tissue of a cell, sample by sample, and the one elastic material that stands for it.
///
/// What is held in space does not give way: the rest of its cell is a layer on it, as much thinner than the cell as its
/// share is, and as much stiffer. A cell of nothing else has the stiffness of what it is made of.
///
/// Where tissues share a cell, the softer one takes the strain, and a tissue stiffens by the strain that it has: a lump's
/// stiffening must not count in the cells of its surface as it does inside. StiffeningMean says how.
class CellMixture {
public:
    /// Adds a sample.
    /// @param row     its tissue
    /// @param weight  fraction of the cell that the sample stands for [-]
    /// @param scale   of its tissue's Young's modulus [-]
    /// @param held    in space
    /// @param place   in the cell, -1 to 1 along each edge
    void add(const TissueRow& row, double weight, double scale, bool held, Vec3 place = Vec3(0.0)) noexcept;
    /// Of what was added; no stiffness where nothing was.
    CellMaterial material() const noexcept;
    /// Fraction of the cell that is tissue [-].
    double fraction() const noexcept { return free_.fraction + held_.fraction; }

private:
    struct Sums {
        double fraction = 0.0, stiffness = 0.0, compliance = 0.0;
        double square = 0.0;  // of moduli
        double softest = std::numeric_limits<double>::infinity();
        Vec3 place{0.0}, stiffest{0.0};  // of places, by weight, and by stiffness
        void add(double weight, double modulus, Vec3 at) noexcept;
        double arithmetic() const noexcept;
        double mean() const noexcept;
        /// What the modulus has over the softest's: its middle, and the share that an even layer of it would take.
        std::pair<Vec3, double> layer() const noexcept;
    } free_, held_;
    double poisson_ = 0.0;
    StiffeningMean stiffening_;
    std::array<double, relaxationTerms> relaxing_{};
};

}  // namespace palpate::volume
