#pragma once

#include <chainmail/quasi_newton.h>
#include <chainmail/window.h>
#include <volume/geometry.h>

#include <vector>

namespace palpate::studies {

/// A body of the kernel's own cells on one grid, without windows, contacts or tracking: nodes that are prescribed, and dead
/// loads. For specimens, whose boundary conditions a session does not have.
class CellBody {
public:
    struct Material {
        double youngsModulus = 0, poisson = 0;  // [Pa], [-]
        double stiffening = 0;                  // b [-]
    };
    /// @param cells   along x, y, z
    /// @param sides   of a cell [m]; cubic
    CellBody(Index3 cells, double side);

    /// @param fraction  of the cell that is tissue [-]; its modulus is so much less
    void fill(Index3 cell, const Material& material, double fraction = 1.0);
    /// Prescribes one component of a node's displacement [m]; again: another value.
    void prescribe(Index3 node, int component, double value);
    /// Adds a dead load to a node [N].
    void load(Index3 node, Vec3 force);
    /// Multiplies displacements, as a start for the next load.
    void scale(double factor) noexcept;

    /// Minimises the energy, see QuasiNewton.
    /// @param tolerance  residual, fraction of the forces that hold and load the body
    /// @returns  whether it got there within `most` evaluations
    bool solve(double tolerance, int most);

    Index3 nodes() const noexcept { return {layout_.nx, layout_.ny, layout_.nz}; }
    Vec3 displacement(Index3 node) const noexcept;  // [m]
    /// Force with which what is prescribed at a node holds it [N].
    Vec3 reaction(Index3 node) const noexcept;
    double energy() const noexcept { return energy_; }  // of the tissue [J]
    double unbalanced() const noexcept { return unbalanced_; }

private:
    std::size_t at(Index3 node, int component) const noexcept;
    void evaluate();
    void precondition(std::vector<double>& values, const chainmail::QuasiNewton::Pair* last) const;

    chainmail::Layout layout_;
    double side_;
    chainmail::Floats mu_, lambda_, stiffening_, narrow_, force_, scratch_;
    std::vector<double> u_, load_, gradient_, diagonal_;  // (fieldSize x 1)
    std::vector<char> given_;
    double energy_ = 0, unbalanced_ = 0;
};

}  // namespace palpate::studies
