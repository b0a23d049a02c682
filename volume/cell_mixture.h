#pragma once

#include <volume/tissue.h>
#include <volume/tissue_table.h>

#include <array>
#include <limits>

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
    // Sums over places in the cell.
    struct Places {
        Vec3 first{0.0};
        Mat3 second{0.0};
        void add(double weight, Vec3 at) noexcept;
        Places times(double factor) const noexcept { return {factor * first, factor * second}; }
        Places minus(const Places& other) const noexcept { return {first - other.first, second - other.second}; }
    };
    // What the modulus has over the softest's: see CellMaterial.
    struct Layer {
        Vec3 middle{0.0}, normal{0.0};
        double share = 0.0;  // that an even layer of it would take
    };
    static Vec3 normalOf(const Places& part) noexcept;
    struct Sums {
        double fraction = 0.0, stiffness = 0.0, compliance = 0.0;
        double square = 0.0;  // of moduli
        double softest = std::numeric_limits<double>::infinity(), stiffest = 0.0;
        Places byWeight, byStiffness;
        void add(double weight, double modulus, Vec3 at) noexcept;
        double arithmetic() const noexcept;
        double mean() const noexcept;
        Layer layer() const noexcept;
    } free_, held_;
    double poisson_ = 0.0;
    StiffeningMean stiffening_;
    std::array<double, relaxationTerms> relaxing_{};
};

}  // namespace palpate::volume
