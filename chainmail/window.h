#pragma once

#include <chainmail/elastic_body.h>
#include <chainmail/kernels.h>
#include <chainmail/window_fragments.h>

#include <glm/vector_relational.hpp>

#include <array>
#include <new>
#include <span>
#include <vector>

namespace palpate::chainmail {

/// Memory that starts on a cache line: vectors of 64 bytes must not straddle two.
template <typename T>
struct CacheAligned {
    using value_type = T;
    CacheAligned() = default;
    template <typename U>
    CacheAligned(const CacheAligned<U>&) noexcept
    {
    }
    T* allocate(std::size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), std::align_val_t(64))); }
    void deallocate(T* p, std::size_t) noexcept { ::operator delete(p, std::align_val_t(64)); }
    bool operator==(const CacheAligned&) const noexcept { return true; }
};
using Floats = std::vector<float, CacheAligned<float>>;

/// What a window keeps for every node: three components each, Layout::fieldSize() floats.
enum class Field : std::uint8_t {
    u,   // displacement [m]
    a,   // A u, by the elastic energy alone [N]
    d,   // the last call's increment of u, over Elastic's scale of it
    e,   // and of a
    p,   // search direction
    q,   // A of what was gone of it
    r,   // residual: force of the contacts less a, where the node is a degree of freedom [N]
    f,   // right side of the cycle
    z,   // its answer
    t,   // working memory
    h,   // history: what relaxation has taken of the tissue's force, all terms together [N]
    h0,  // the same of each term; these three only where the body relaxes
    h1,
    count
};
static_assert(volume::relaxationTerms == 2, "a field for each term");
inline constexpr std::size_t fieldCount = static_cast<std::size_t>(Field::count);

/// False for every n where `first` is not before `last`.
inline bool isBetween(Index3 n, Index3 first, Index3 last) noexcept
{
    return glm::all(glm::greaterThanEqual(n, first)) && glm::all(glm::lessThanEqual(n, last));
}

/// The thin layers of the cells in a box.
class LayerFields {
public:
    /// @param box  nodes that have cells with layers between them
    /// @param any  the level has layers; where it has none, nothing is kept
    LayerFields(const Layout& layout, Index3 box, bool any);
    /// Takes those of the level's cells from `at` on.
    void place(const CellLevel& level, Index3 at) noexcept;
    /// What the kernels take; without a modulus where no cell of the box has a layer.
    CellLayers view() const noexcept { return with(mu_); }
    /// The same with another modulus.
    CellLayers with(const Floats& mu) const noexcept;
    const Floats& mu() const noexcept { return mu_; }

private:
    void set(std::size_t cell, const CellLayer& layer, float scale) noexcept;

    Layout layout_;
    Index3 box_{0};
    Floats mu_;
    std::array<Floats, 3> normal_, middle_, half_;
    std::vector<std::uint8_t> places_;
    bool some_ = false;
};

/// How cells are filled, in a box and behind it.
class CutFields {
public:
    CutFields(const Layout& layout, Index3 box);
    /// Takes those of the level's cells from `at` on. Behind the box no cell is cut.
    void place(const CellLevel& level, Index3 at) noexcept;
    void set(std::size_t cell, const Cut& cut) noexcept;
    Cut at(std::size_t cell) const noexcept;
    /// Finds where cells have no modulus, and where whole ones do not stiffen; until then none do. Those that are set later
    /// are cut.
    void classify(const Floats& mu, const Floats& stiffening) noexcept;
    /// What the kernels take.
    CutCells view() const noexcept;
    const Filling* filling() const noexcept { return filling_.data(); }

private:
    Layout layout_;
    Index3 box_{0};
    std::array<Floats, 3> middle_, spread_;
    std::vector<Filling> filling_;
};

/// A box of nodes of one level that follows the tool. Windows are nested; together they are one finite-element space:
///
///     +-----------------------------+      a node that tissue holds which no finer window covers is a degree of
///     |           4 h               |      freedom, see WindowStack::findFreedom(); a node on a window's border takes
///     |    +----------------+       |      what the next coarser window has there (trilinear), so that the displacement
///     |    |     2 h        |       |      is continuous, but where a wider window has nothing but air beyond
///     |    |   +--------+   |       |
///     |    |   |  h     |   |       |
///     |    |   +--------+   |       |
///     |    +----------------+       |
///     +-----------------------------+
///
/// The masks are 1 or 0 per node, so that the kernels multiply where others would branch.
struct Window {
    Index3 box{0};      // nodes
    Layout layout;      // of the box, and of the planes behind it with fragments: their number changes where windows move
    Index3 low{-1};     // index of node (0, 0, 0) in the level; even but in the coarsest window; -1: none yet
    Floats mu, lambda;  // of each cell, times spacing / 32 [N/m]
    Floats stiffening;  // of each cell [-]
    Floats uncoveredMu, uncoveredLambda;  // the same, zero in cells that a finer window covers
    LayerFields layers;                   // of the finest window only
    CutFields cuts;
    struct Term {
        Floats mu, lambda, layer;
    };
    std::array<Term, volume::relaxationTerms> terms;  // of the Prony series: uncovered moduli times its weight
    Floats diagonal;  // reciprocal of the operator's diagonal, zero where the node is not free
    Floats border;    // nodes that follow the next coarser window
    Floats open;      // free, or border
    Floats dof;       // degrees of freedom: free, and held by tissue that is not covered
    Floats tissue;    // nodes of a cell with tissue
    WindowFragments fragments;
    std::array<Floats, fieldCount> fields;
    float relief = 0;     // CellStiffness::relief of its cells
    float weight = 0.2F;  // of the smoother

    float* field(Field f) noexcept { return fields[static_cast<std::size_t>(f)].data(); }
    const float* field(Field f) const noexcept { return fields[static_cast<std::size_t>(f)].data(); }
    CellStiffness stiffness() const noexcept { return stiffnessOf(mu, lambda, layers.view()); }
    CellStiffness uncovered() const noexcept { return stiffnessOf(uncoveredMu, uncoveredLambda, layers.view()); }
    CellStiffness term(std::size_t i) const noexcept
    {
        return stiffnessOf(terms[i].mu, terms[i].lambda, layers.with(terms[i].layer));
    }
    Index3 size() const noexcept { return box; }
    /// Node (0, 0, 0) of this window in the next coarser one.
    Index3 offsetIn(const Window& coarse) const noexcept { return low / 2 - coarse.low; }
    /// True when one of the box's cells from `first` to `last` has tissue that no finer window covers.
    bool anyUncovered(Index3 first, Index3 last) const noexcept;
    bool contains(Index3 node) const noexcept  // in the level's indices
    {
        return base::holds(box, node - low);
    }
    std::size_t at(Index3 node) const noexcept
    {
        const Index3 n = node - low;
        return layout.at(n.x, n.y, n.z);
    }

    Vec3 value(Field f, std::size_t node) const noexcept
    {
        const float* v = field(f) + node;
        return {v[0], v[layout.count], v[2 * layout.count]};
    }
    void set(Field f, std::size_t node, Vec3 value) noexcept
    {
        float* v = field(f) + node;
        for (int c = 0; c < 3; ++c, v += layout.count) {
            *v = static_cast<float>(value[c]);
        }
    }
    void add(Field f, std::size_t node, Vec3 value) noexcept
    {
        float* v = field(f) + node;
        for (int c = 0; c < 3; ++c, v += layout.count) {
            *v += static_cast<float>(value[c]);
        }
    }
    /// Calls visit(parent, share) for the nodes of the next coarser window that interpolate to this one.
    template <typename Visit>
    void visitParents(std::size_t node, const Window& coarse, Visit&& visit) const noexcept
    {
        if (const WindowFragments::Link* link = fragments.linkOf(node)) {
            for (std::size_t i = 0; i < link->count; ++i) {
                visit(link->parents[i], 1.0 / static_cast<double>(link->count));
            }
            return;
        }
        visitParentsByPlace(node, coarse, visit);
    }
    /// The same as if it had no link. @pre it is a node of the box
    template <typename Visit>
    void visitParentsByPlace(std::size_t node, const Window& coarse, Visit&& visit) const noexcept
    {
        const Index3 n = low + Index3(node % layout.row, node % layout.plane / layout.row, node / layout.plane);
        const Index3 odd = n % 2;
        const double fraction = 1.0 / static_cast<double>((1 + odd.x) * (1 + odd.y) * (1 + odd.z));
        volume::forEachIndex(n / 2, n / 2 + odd, [&](Index3 parent) { visit(coarse.at(parent), fraction); });
    }

    /// Gives copies of a node what the node has, and the node what was given to its copies: see WindowFragments.
    void share(Field f) noexcept { fragments.share(field(f), layout.count); }
    void collect(Field f) noexcept { fragments.collect(field(f), layout.count); }

    Window(const CellLevel& level, Index3 size, bool relaxes);

    /// Nodes that it has room for.
    std::size_t room() const noexcept { return mu.size() - Layout::lanes; }

    /// Takes its cells' stiffness from the level, at `at`, and makes the masks but `dof`. `coarser`: the next coarser
    /// level; without one the window has no border. `freeInAir`: no border either where there is nothing but air beyond.
    void place(const CellLevel& level, Index3 at, const CellLevel* coarser, bool freeInAir) noexcept;
    /// Leaves out what `finer`, the next finer window, covers.
    void cover(const Window& finer) noexcept;
    /// Adds how many cells with tissue that no finer window covers are around each node. Copies keep what is theirs.
    void countTissue(float* around) const noexcept;
    /// Makes degrees of freedom of the free nodes where `held` is not zero, which is then 1 where the border is held, else
    /// 0.
    void freeWhereHeld(float* held) noexcept;

private:
    CellStiffness stiffnessOf(const Floats& shear, const Floats& lame, const CellLayers& thin) const noexcept
    {
        return {shear.data(), lame.data(), stiffening.data(), thin, cuts.view(), cuts.filling(), relief};
    }
    void placeBorder(const CellLevel& coarser, bool freeInAir) noexcept;
    void coverFragments(Index3 first, Index3 cells) noexcept;
    void placeNodes(const CellLevel& level) noexcept;
    void placeFragments(const CellLevel& level, bool coarsest) noexcept;
    void keepWhole(const CellLevel& level, const CellFragment& fragment) noexcept;
    void placeTerm(const CellLevel& level, std::size_t i) noexcept;
};

/// fine = P coarse: trilinear, at all nodes of the fine window.
void prolong(const Kernels& k, const Window& coarse, const float* from, const Window& fine, float* to) noexcept;

/// coarse += P^T fine. `scratch`: as for Kernels::apply() on the fine window.
void restrictAdd(const Kernels& k, const Window& fine, const float* from, const Window& coarse, float* to,
                 float* scratch) noexcept;

/// Drops a force where a window has no degree of freedom of its own.
void keepWhereFree(const Window& w, float* force) noexcept;

/// A force at nodes of the coarse window that the fine one covers goes to the fine one's nodes at the same places. So does
/// that at nodes on its border which have no tissue of the coarse window's own around them, to the next node inside: there
/// next to nothing would hold against it.
void handDown(Window& coarse, Field field, Window& fine) noexcept;

/// coarse = fine where the coarse window has a node that the fine one covers. Uses up Field::t of both.
void inject(Window& fine, Window& coarse, std::span<const Field> fields) noexcept;

/// Moves what a field holds to a window's new place; `to` keeps what it has where the old window was not.
/// @param oldCount  Layout::count then
void carryOver(const Window& window, Index3 oldLow, std::size_t oldCount, const float* from, float* to) noexcept;

}  // namespace palpate::chainmail
