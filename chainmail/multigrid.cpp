#include <chainmail/multigrid.h>

#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::chainmail {

namespace {

constexpr double margin = 1.05;        // on the estimate of the largest eigenvalue
constexpr double smoothed = 4.0;       // the smoother takes the upper three quarters of the spectrum
constexpr int coarsestSteps = 8;       // Chebyshev steps on the coarsest level
constexpr double coarsestSpread = 40;  // largest to smallest eigenvalue there

Vec3 valueAt(const Window& w, std::size_t node, Field field) noexcept
{
    const float* f = w.field(field) + node;
    return {f[0], f[w.layout.count], f[2 * w.layout.count]};
}

void addAt(Window& w, std::size_t node, Field field, Vec3 v) noexcept
{
    float* f = w.field(field) + node;
    for (int c = 0; c < 3; ++c, f += w.layout.count) {
        *f += static_cast<float>(v[c]);
    }
}

}  // namespace

Multigrid::Multigrid(WindowStack& stack, std::size_t maxBlocks) : stack_(stack)
{
    for (std::size_t l = 0; l < stack_.size(); ++l) {
        blocks_.emplace_back().reserve(maxBlocks);
        blockOf_.emplace_back(stack_[l].layout.count, 0U);
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
                b.inverse = glm::inverse(glm::dmat3(1.0 / static_cast<double>(w.weight * b.diagonal)) + b.stiffness);
            }
            if (l + 1 < blocks_.size()) {
                const auto at = static_cast<std::size_t>(b.node);
                const Index3 n = w.low + Index3(at % w.layout.row, at % w.layout.plane / w.layout.row, at / w.layout.plane);
                const Index3 odd = n % 2;
                const double share = 1.0 / static_cast<double>((1 + odd.x) * (1 + odd.y) * (1 + odd.z));
                volume::forEachIndex(n / 2, n / 2 + odd, [&](Index3 parent) {
                    addContact(l + 1, stack_[l + 1].at(parent), share * b.stiffness);
                });
            }
        }
    }
}

// t = (A + contacts) z on one window.
void Multigrid::operate(std::size_t level) noexcept
{
    Window& w = stack_[level];
    stack_.kernels().apply(w.layout, w.stiffness(), w.field(Field::z), w.field(Field::t), stack_.scratch());
    for (const Block& b : blocks_[level]) {
        addAt(w, b.node, Field::t, b.stiffness * valueAt(w, b.node, Field::z));
    }
}

// The smoother's step at nodes with contacts: z += (D / weight + B)^-1 (r - t), t = 0 in the first.
void Multigrid::smoothContacts(std::size_t level, bool first) noexcept
{
    Window& w = stack_[level];
    for (const Block& b : blocks_[level]) {
        if (b.diagonal > 0.0F) {
            const Vec3 off = valueAt(w, b.node, Field::r) - (first ? Vec3(0.0) : valueAt(w, b.node, Field::t));
            addAt(w, b.node, Field::z, b.inverse * off);
        }
    }
}

void Multigrid::solveCoarsest() noexcept
{
    Window& w = stack_[stack_.size() - 1];
    const Kernels& k = stack_.kernels();
    // Roots of the Chebyshev polynomial on the operator's spectrum, largest weights spread between small ones.
    const double high = 2.0 / static_cast<double>(w.weight) / (1.0 + 1.0 / smoothed);
    const double low = high / coarsestSpread;
    constexpr std::array<int, coarsestSteps> order{0, 7, 3, 4, 1, 6, 2, 5};
    for (int s = 0; s < coarsestSteps; ++s) {
        const double angle = std::numbers::pi * (order[static_cast<std::size_t>(s)] + 0.5) / coarsestSteps;
        const float weight = static_cast<float>(1.0 / (0.5 * (high + low) + 0.5 * (high - low) * std::cos(angle)));
        if (s == 0) {
            k.smoothFirst(weight, w.diagonal.data(), w.field(Field::r), w.field(Field::z), w.layout.count);
        } else {
            operate(stack_.size() - 1);
            k.smooth(weight, w.diagonal.data(), w.field(Field::r), w.field(Field::t), w.field(Field::z), w.layout.count);
        }
        smoothContacts(stack_.size() - 1, s == 0);
    }
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
    smoothContacts(level, true);
    operate(level);
    k.residual(w.open.data(), w.field(Field::r), w.field(Field::t), w.field(Field::t), w.layout.count);

    Window& coarse = stack_[level + 1];
    restrictAdd(k, w, w.field(Field::t), coarse, coarse.field(Field::r), stack_.scratch());
    cycle(level + 1);

    prolong(k, coarse, coarse.field(Field::z), w, w.field(Field::t));
    k.addMasked(w.open.data(), w.field(Field::t), w.field(Field::z), w.layout.count);
    operate(level);
    k.smooth(w.weight, w.diagonal.data(), w.field(Field::r), w.field(Field::t), w.field(Field::z), w.layout.count);
    smoothContacts(level, false);
}

}  // namespace palpate::chainmail
