#pragma once

#include <chainmail/window_stack.h>

#include <glm/mat3x3.hpp>

#include <vector>

namespace palpate::chainmail {

/// One multigrid cycle over the windows: z is about A^-1 r, symmetric and positive definite, so that it may precondition
/// conjugate gradients. One damped Jacobi step before and one after each coarser level; Chebyshev steps on the coarsest.
///
/// Contacts join as a 3 x 3 stiffness at each node near them, lumped: at least as stiff as they are, on every level.
class Multigrid {
public:
    /// @param maxBlocks  nodes with contact stiffness per level
    Multigrid(WindowStack& stack, std::size_t maxBlocks);

    /// Forgets all contact stiffness.
    void clearContacts() noexcept;
    /// Adds stiffness of a contact at a node [N/m].
    void addContact(std::size_t level, std::size_t node, const glm::dmat3& stiffness) noexcept;
    /// Takes the contacts to the coarser levels and prepares their smoothers: after the last addContact().
    void prepare() noexcept;

    /// z = M^-1 r; r is zero but at degrees of freedom. What it holds on the coarser windows is used up.
    void solve() noexcept { cycle(0); }

private:
    struct Block {
        std::uint32_t node = 0;
        float diagonal = 0;  // what the window's smoother had there
        glm::dmat3 stiffness{0.0};
        glm::dmat3 inverse{0.0};  // of smoother's diagonal and stiffness together
    };

    void cycle(std::size_t level) noexcept;
    void operate(Window& coarsest) noexcept;
    void addContacts(std::size_t level, double sign) noexcept;
    void smoothContacts(std::size_t level, Field field, bool first, double weight) noexcept;
    static void smoothCopies(Window& window) noexcept;
    void solveCoarsest() noexcept;

    WindowStack& stack_;
    std::vector<std::vector<Block>> blocks_;           // by level
    std::vector<std::vector<std::uint32_t>> blockOf_;  // by level and node: index in blocks_ + 1, 0 = none
};

}  // namespace palpate::chainmail
