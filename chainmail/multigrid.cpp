#include <chainmail/multigrid.h>

#include <glm/matrix.hpp>

#include <algorithm>
#include <cstring>

namespace palpate::chainmail {

constexpr double margin = 1.05;        // on the estimate of the largest eigenvalue
constexpr double smoothed = 4.0;       // the smoother takes the upper three quarters of the spectrum
constexpr int coarsestSteps = 4;       // Chebyshev steps on the coarsest level
constexpr double coarsestSpread = 20;  // largest to smallest eigenvalue there

Multigrid::Multigrid(WindowStack& stack, std::size_t maxBlocks) : stack_(stack)
{
    for (std::size_t l = 0; l < stack_.size(); ++l) {
        const std::size_t nodes = stack_[l].room();
        blocks_.emplace_back().reserve(std::min(maxBlocks, nodes));
        blockOf_.emplace_back(nodes, 0U);
    }
    for (std::size_t l = 0; l < stack_.size(); ++l) {
        const double largest = margin * stack_.body().levels[l].radius;
        stack_[l].weight = static_cast<float>(2.0 / (largest + largest / smoothed));
    }
}

void Multigrid::clearContacts() noexcept
{
    for (std::size_t l = 0; l < blocks_.size(); ++l) {
        for (const Block& b : blocks_[l]) {
            stack_[l].diagonal[b.node] = b.diagonal;
            blockOf_[l][b.node] = 0;
        }
        blocks_[l].clear();
    }
}

void Multigrid::addContact(std::size_t level, std::size_t node, const glm::dmat3& stiffness) noexcept
{
    node = stack_[level].fragments.original(node);
    std::uint32_t& index = blockOf_[level][node];
    if (index == 0) {
        if (blocks_[level].size() == blocks_[level].capacity()) {
            return;
        }
        blocks_[level].push_back({static_cast<std::uint32_t>(node), 0.0F, glm::dmat3(0.0), glm::dmat3(0.0)});
        index = static_cast<std::uint32_t>(blocks_[level].size());
    }
    blocks_[level][index - 1].stiffness += stiffness;
}

void Multigrid::prepare() noexcept
{
    for (std::size_t l = 0; l < blocks_.size(); ++l) {
        Window& w = stack_[l];
        for (Block& b : blocks_[l]) {
            b.diagonal = w.diagonal[b.node];
            w.diagonal[b.node] = 0.0F;
            if (b.diagonal > 0.0F) {
                // On the coarsest level the weight comes with the step.
                const double weight = l + 1 < blocks_.size() ? static_cast<double>(w.weight) : 1.0;
                b.inverse = glm::inverse(glm::dmat3(1.0 / (weight * static_cast<double>(b.diagonal))) + b.stiffness);
            }
            if (l + 1 < blocks_.size()) {
                w.visitParents(b.node, stack_[l + 1], [&](std::size_t parent, double fraction) {
                    addContact(l + 1, parent, fraction * b.stiffness);
                });
            }
        }
    }
}

// t = (A + contacts) z on the coarsest window.
void Multigrid::operate(Window& w) noexcept
{
    w.share(Field::z);
    stack_.kernels().apply(w.layout, w.stiffness(), w.field(Field::z), w.field(Field::t), stack_.scratch());
    w.collect(Field::t);
    addContacts(stack_.size() - 1, 1.0);
}

// t += sign * contacts' z, at nodes that are not held.
void Multigrid::addContacts(std::size_t level, double sign) noexcept
{
    Window& w = stack_[level];
    for (const Block& b : blocks_[level]) {
        const double open = sign * static_cast<double>(w.open[b.node]);
        w.add(Field::t, b.node, open * (b.stiffness * w.value(Field::z, b.node)));
    }
}

// The smoother's step at nodes with contacts: z += (D / weight + B)^-1 (r - t), t = 0 in the first.
void Multigrid::smoothContacts(std::size_t level, Field field, bool first, double weight) noexcept
{
    Window& w = stack_[level];
    for (const Block& b : blocks_[level]) {
        if (b.diagonal > 0.0F) {
            const Vec3 off = w.value(Field::r, b.node) - (first ? Vec3(0.0) : w.value(Field::t, b.node));
            w.add(field, b.node, weight * (b.inverse * off));
        }
    }
}

// Chebyshev's three-term recurrence on [high / spread, high]; the steps add up in f, which is free until the cycle is done.
// Source: Y. Saad, "Iterative Methods for Sparse Linear Systems", 2nd ed., algorithm 12.1.
void Multigrid::solveCoarsest() noexcept
{
    const std::size_t level = stack_.size() - 1;
    Window& w = stack_[level];
    const Kernels& k = stack_.kernels();
    const std::size_t n = w.layout.count;
    const double high = margin * stack_.body().levels[level].radius;
    const double low = high / coarsestSpread;
    const double middle = 0.5 * (high + low);
    const double half = 0.5 * (high - low);
    double rho = half / middle;
    k.smoothFirst(static_cast<float>(1.0 / middle), w.diagonal.data(), w.field(Field::r), w.field(Field::f), n);
    smoothContacts(level, Field::f, true, 1.0 / middle);
    std::memcpy(w.field(Field::z), w.field(Field::f), 3 * n * sizeof(float));
    for (int s = 1; s < coarsestSteps; ++s) {
        operate(w);
        const double next = 1.0 / (2.0 * middle / half - rho);
        const double weight = 2.0 * next / half;
        const auto shrink = static_cast<float>(next * rho);
        const Defect defect{w.diagonal.data(), w.field(Field::r), w.field(Field::t), n};
        k.chebyshev(shrink, static_cast<float>(weight), defect, w.field(Field::f), w.field(Field::z));
        smoothContacts(level, Field::f, false, weight);
        smoothContacts(level, Field::z, false, weight);
        rho = next;
    }
    w.share(Field::z);
}

// What the smoother's step lacks of the copies' t, where it is swept with that of their originals alone.
void Multigrid::smoothCopies(Window& w) noexcept
{
    for (const WindowFragments::Copy& copy : w.fragments.copies()) {
        const double factor = -static_cast<double>(w.weight * w.diagonal[copy.original]);
        w.add(Field::z, copy.original, factor * w.value(Field::t, copy.at));
    }
    w.collect(Field::t);
}

void Multigrid::cycle(std::size_t level) noexcept
{
    Window& w = stack_[level];
    const Kernels& k = stack_.kernels();
    if (level + 1 == stack_.size()) {
        solveCoarsest();
        return;
    }
    k.smoothFirst(w.weight, w.diagonal.data(), w.field(Field::r), w.field(Field::z), w.layout.count);
    smoothContacts(level, Field::z, true, 1.0);
    w.share(Field::z);
    k.residualOf(w.layout, w.stiffness(), w.open.data(), w.field(Field::r), w.field(Field::z), w.field(Field::t),
                 stack_.scratch());
    w.collect(Field::t);
    addContacts(level, -1.0);

    Window& coarse = stack_[level + 1];
    restrictAdd(k, w, w.field(Field::t), coarse, coarse.field(Field::r), stack_.scratch());
    cycle(level + 1);

    prolong(k, coarse, coarse.field(Field::z), w, w.field(Field::t));
    k.addMasked(w.open.data(), w.field(Field::t), w.field(Field::z), w.layout.count);
    w.share(Field::z);
    const Smoother smoother{w.weight, w.diagonal.data(), w.field(Field::r)};
    k.smoothOf(w.layout, w.stiffness(), smoother, w.field(Field::z), w.field(Field::t), stack_.scratch());
    smoothCopies(w);
    addContacts(level, 1.0);
    smoothContacts(level, Field::z, false, 1.0);
    w.share(Field::z);
}

}  // namespace palpate::chainmail
