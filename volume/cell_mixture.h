#pragma once

#include <volume/tissue.h>
#include <volume/tissue_table.h>

#include <array>

namespace palpate::volume {

/// The tissue of a cell, sample by sample, and the one elastic material that stands for it.
///
/// What is held in space does not give way: the rest of its cell is a layer on it, as much thinner than the cell as its
/// share is, and as much stiffer. A cell of nothing else has the stiffness of what it is made of.
class CellMixture {
public:
    /// Adds a sample.
    /// @param row     its tissue
    /// @param weight  fraction of the cell that the sample stands for [-]
    /// @param scale   of its tissue's Young's modulus [-]
    void add(const TissueRow& row, double weight, double scale) noexcept;
    /// Of what was added; no stiffness where nothing was.
    CellMaterial material() const noexcept;
    /// Fraction of the cell that is tissue [-].
    double fraction() const noexcept { return free_.fraction + held_.fraction; }

private:
    struct Sums {
        double fraction = 0.0, stiffness = 0.0, compliance = 0.0;
        void add(double weight, double modulus) noexcept;
        double mean() const noexcept;
    } free_, held_;
    double poisson_ = 0.0;
    double stiffening_ = 0.0;
    std::array<double, relaxationTerms> relaxing_{};
};

}  // namespace palpate::volume
