#pragma once

#include <base/cells.h>

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <cstdint>
#include <span>
#include <vector>

namespace palpate::channel {

/// Where at rest lies what is seen at a place: the inverse of x = X + u(X), u trilinear between the nodes of a lattice and
/// zero beyond it. All in lattice units: places in spacings from the lattice's origin, and displacements in spacings too.
///
/// Newton's method from where the last point ended, from the place itself, and along X + t u(X), t from 0 to 1. What it
/// finds holds wherever the tissue is not folded, for there X is the only one. In a fold three or more X lie at one x:
/// around folds the cells themselves are searched, and of their answers the one that has moved least is taken among those
/// that are not inside out, so that the answer does not depend on the way to it.
class Inverse {
public:
    /// Nodes along each axis, and how many of their units are a metre.
    Inverse(glm::ivec3 size, float perMetre);

    /// Takes the displacements as they are from now on; to be called after each change.
    /// @param u      per node [m]; the fourth is not looked at (nodes x 1). Must outlive this or the next call
    /// @param moved  the nodes that are not at rest
    void update(std::span<const glm::vec4> u, std::span<const std::uint32_t> moved);

    static constexpr float close = 0.01F;  // spacings: what pictures of a body need

    /// Takes shift(g) = X - x to what solves shift + u(g + shift) = 0.
    /// `enough`: error along each axis [spacings]; around folds it is half of `close`.
    void follow(glm::vec3 g, glm::vec3& shift, float enough = close) const noexcept;

    /// u at the rest place `g`.
    glm::vec3 displacement(glm::vec3 g) const noexcept { return local(g).u; }
    /// Cells that are folded, or nearly so.
    std::size_t folds() const noexcept { return folds_; }

private:
    struct Local {
        glm::vec3 u{0.0F};
        glm::mat3 deformation{1.0F};  // d(X + u) / dX
    };
    struct Box {
        glm::vec3 low{0.0F}, high{-1.0F};

        bool holds(glm::vec3 p) const noexcept;
        void add(glm::vec3 p) noexcept;
    };
    struct Answer {
        glm::vec3 shift{0.0F};
        float cost = -1;  // below 0: none
    };

    std::size_t at(glm::ivec3 n) const noexcept { return base::offsetOf(size_, n); }
    Local local(glm::vec3 g) const noexcept;
    Local inCell(glm::ivec3 cell, glm::vec3 part) const noexcept;
    Box seen(glm::ivec3 cell) const noexcept;
    bool newton(glm::vec3 g, float fraction, int steps, float enough, glm::vec3& shift) const noexcept;
    bool alongTheWay(glm::vec3 g, float enough, glm::vec3& shift) const noexcept;
    bool solveInCell(glm::ivec3 cell, glm::vec3 g, glm::vec3& part, float& volume) const noexcept;
    void tryCell(glm::ivec3 cell, glm::vec3 g, Answer& best) const noexcept;
    Answer searched(glm::vec3 g) const noexcept;
    void findFolds(std::span<const std::uint32_t> moved);
    void checkCell(glm::ivec3 cell);
    void indexCells();
    template <typename Visit>
    void forEachCellNear(const Box& place, Visit&& visit) const;
    std::size_t bin(glm::ivec3 n) const noexcept { return base::offsetOf(bins_, n); }

    glm::ivec3 size_;
    float perMetre_;
    std::span<const glm::vec4> u_;
    glm::vec3 least_{0.0F}, most_{0.0F};  // of u, along each axis
    std::vector<std::uint32_t> checked_;  // per cell: the last update that looked whether it is folded
    std::uint32_t updates_ = 0;
    std::size_t folds_ = 0;
    Box folded_;                        // where folded cells are seen
    glm::ivec3 binLow_{0}, bins_{0};    // unit cubes that cover it
    std::vector<std::uint32_t> first_;  // per bin: its first cell in cells_, and the end
    std::vector<std::uint32_t> cells_;  // seen in the bin
};

}  // namespace palpate::channel
