#include <chainmail/window.h>

#include <glm/common.hpp>

#include <algorithm>

namespace palpate::chainmail {

namespace {

// Calls `use` with each cell of the box from `at` on.
template <typename T, typename Use>
void forEachIn(const std::vector<T>& all, const std::vector<std::uint32_t>& rows, int sizeY, Index3 at, Index3 box,
               Index3 T::*place, Use&& use) noexcept
{
    for (int z = at.z; z + 1 < at.z + box.z; ++z) {
        for (int y = at.y; y + 1 < at.y + box.y; ++y) {
            const auto row = static_cast<std::size_t>(y + z * sizeY);
            for (const T& t : inRow(all, rows, row, at.x, at.x + box.x - 2, place)) {
                use(t);
            }
        }
    }
}

}  // namespace

LayerFields::LayerFields(const Layout& layout, Index3 box, bool any) : layout_(layout), box_(box)
{
    const std::size_t room = any ? layout.count + Layout::lanes : 0;
    mu_.assign(room, 0.0F);
    places_.assign(room / Layout::lanes, 0);
    for (std::size_t c = 0; c < 3; ++c) {
        normal_[c].assign(room, 0.0F);
        middle_[c].assign(room, 0.0F);
        half_[c].assign(room, 0.0F);
    }
}

// A layer lies in the cell; the kernels want it from the middle of the cell's tissue.
void LayerFields::place(const CellLevel& level, Index3 at) noexcept
{
    some_ = false;
    std::fill(mu_.begin(), mu_.end(), 0.0F);
    std::fill(places_.begin(), places_.end(), std::uint8_t{0});
    forEachIn(level.layers, level.layerRows, level.nodes.size.y, at, box_, &CellLayer::cell, [&](CellLayer layer) {
        const Index3 cell = layer.cell - at;
        layer.middle -= cutOf(level, layer.cell).middle;
        set(layout_.at(cell.x, cell.y, cell.z), layer, static_cast<float>(level.nodes.spacing / 32.0));
    });
}

void LayerFields::set(std::size_t cell, const CellLayer& layer, float scale) noexcept
{
    mu_[cell] = scale * layer.mu;
    for (int c = 0; c < 3; ++c) {
        normal_[static_cast<std::size_t>(c)][cell] = layer.normal[c];
        middle_[static_cast<std::size_t>(c)][cell] = layer.middle[c];
        half_[static_cast<std::size_t>(c)][cell] = layer.half[c];
    }
    std::uint8_t& places = places_[cell / Layout::lanes];
    places = std::max<std::uint8_t>(places, layer.half == Vec3f(0.0F) ? 1 : 2);
    some_ = true;
}

CellLayers LayerFields::with(const Floats& mu) const noexcept
{
    if (!some_) {
        return {};
    }
    return {mu.data(),
            {normal_[0].data(), normal_[1].data(), normal_[2].data()},
            {middle_[0].data(), middle_[1].data(), middle_[2].data()},
            {half_[0].data(), half_[1].data(), half_[2].data()},
            places_.data()};
}

CutFields::CutFields(const Layout& layout, Index3 box) : layout_(layout), box_(box)
{
    const std::size_t room = layout.count + Layout::lanes;
    filling_.assign(room / Layout::lanes, Filling::whole);
    for (std::size_t c = 0; c < 3; ++c) {
        middle_[c].assign(room, 0.0F);
        spread_[c].assign(room, 1.0F);
    }
}

void CutFields::place(const CellLevel& level, Index3 at) noexcept
{
    std::fill(filling_.begin(), filling_.end(), Filling::whole);
    for (std::size_t c = 0; c < 3; ++c) {
        std::fill(middle_[c].begin(), middle_[c].end(), 0.0F);
        std::fill(spread_[c].begin(), spread_[c].end(), 1.0F);
    }
    forEachIn(level.cuts, level.cutRows, level.nodes.size.y, at, box_, &CutCell::cell, [&](const CutCell& c) {
        const Index3 cell = c.cell - at;
        set(layout_.at(cell.x, cell.y, cell.z), c.cut);
    });
}

void CutFields::set(std::size_t cell, const Cut& cut) noexcept
{
    if (cut.isWhole()) {
        return;
    }
    for (int c = 0; c < 3; ++c) {
        middle_[static_cast<std::size_t>(c)][cell] = cut.middle[c];
        spread_[static_cast<std::size_t>(c)][cell] = cut.spread[c];
    }
    filling_[cell / Layout::lanes] = Filling::cut;
}

Cut CutFields::at(std::size_t cell) const noexcept
{
    return {{middle_[0][cell], middle_[1][cell], middle_[2][cell]}, {spread_[0][cell], spread_[1][cell], spread_[2][cell]}};
}

void CutFields::classify(const Floats& mu, const Floats& stiffening) noexcept
{
    const auto none = [](const Floats& of, std::size_t i) {
        const auto first = of.begin() + static_cast<std::ptrdiff_t>(i * Layout::lanes);
        return std::all_of(first, first + Layout::lanes, [](float v) { return v == 0.0F; });
    };
    for (std::size_t i = 0; i < filling_.size(); ++i) {
        if (none(mu, i)) {
            filling_[i] = Filling::empty;
        } else if (filling_[i] == Filling::whole && none(stiffening, i)) {
            filling_[i] = Filling::constant;
        }
    }
}

CutCells CutFields::view() const noexcept
{
    return {{middle_[0].data(), middle_[1].data(), middle_[2].data()},
            {spread_[0].data(), spread_[1].data(), spread_[2].data()}};
}

bool Window::anyUncovered(Index3 first, Index3 last) const noexcept
{
    bool any = false;
    volume::forEachIndex(glm::max(first, Index3(0)), glm::min(last, box - 2),
                         [&](Index3 c) { any = any || uncoveredMu[layout.at(c.x, c.y, c.z)] > 0.0F; });
    return any;
}

Window::Window(const CellLevel& level, Index3 size, bool relaxes)
    : box(size),
      layout(Layout::of(size.x, size.y, WindowFragments::planes(level, size))),
      layers(layout, size, !level.layers.empty()),
      cuts(layout, size),
      fragments(level, size)
{
    for (Floats* cells :
         {&mu, &lambda, &stiffening, &uncoveredMu, &uncoveredLambda, &diagonal, &border, &open, &dof, &tissue}) {
        cells->assign(layout.count + Layout::lanes, 0.0F);
    }
    const auto always = relaxes ? fieldCount : static_cast<std::size_t>(Field::h);
    for (std::size_t i = 0; i < always; ++i) {
        fields[i].assign(layout.fieldSize(), 0.0F);
    }
    for (Term& term : terms) {
        term.mu.assign(relaxes ? layout.count + Layout::lanes : 0, 0.0F);
        term.lambda = term.mu;
        term.layer.assign(relaxes ? layers.mu().size() : 0, 0.0F);
    }
}

namespace {

// Whether the coarser level has no tissue outside of the window at node n, on its border, and does not hold it either.
bool isAirBeyond(Index3 n, const Window& w, const CellLevel& coarser) noexcept
{
    const Index3 at = w.low + n, end = coarser.nodes.size - 1;
    bool air = true;
    volume::forEachIndex(at / 2, at / 2 + at % 2,
                         [&](Index3 parent) { air = air && coarser.fixed[coarser.nodes.offset(parent)] == 0; });
    const auto look = [&](Index3 cell) {
        air = air && coarser.mu[coarser.nodes.offset(cell)] == 0.0F &&
              coarser.fragments.in(cell, coarser.nodes.size.y).empty();
    };
    for (int axis = 0; axis < 3; ++axis) {
        Index3 first = (at - 1) / 2, last = at / 2;  // of the cells around it
        if (n[axis] == 0) {
            first[axis] = last[axis] = at[axis] / 2 - 1;
        } else if (n[axis] == w.box[axis] - 1) {
            first[axis] = last[axis];
        } else {
            continue;
        }
        volume::forEachIndex(glm::max(first, Index3(0)), glm::min(last, end - 1), look);
    }
    return air;
}

}  // namespace

void Window::place(const CellLevel& level, Index3 at, const CellLevel* coarser, bool freeInAir) noexcept
{
    low = at;
    const float scale = static_cast<float>(level.nodes.spacing / 32.0);
    for (int k = 0; k + 1 < box.z; ++k) {
        for (int j = 0; j + 1 < box.y; ++j) {
            const std::size_t from = level.nodes.offset(low + Index3(0, j, k));
            const std::size_t to = layout.at(0, j, k);
            for (std::size_t i = 0; i + 1 < static_cast<std::size_t>(layout.nx); ++i) {
                mu[to + i] = scale * level.mu[from + i];
                lambda[to + i] = scale * level.lambda[from + i];
                stiffening[to + i] = level.stiffening[from + i];
            }
        }
    }
    layers.place(level, at);
    cuts.place(level, at);
    std::copy(mu.begin(), mu.end(), uncoveredMu.begin());
    std::copy(lambda.begin(), lambda.end(), uncoveredLambda.begin());
    for (std::size_t i = 0; i < terms.size() && !terms[i].mu.empty(); ++i) {
        placeTerm(level, i);
    }
    placeNodes(level);
    if (coarser != nullptr) {
        placeBorder(*coarser, freeInAir);
    }
    placeFragments(level, coarser == nullptr);
    cuts.classify(mu, stiffening);
}

// Nodes over the surface with nothing but air beyond them stay free: the coarser window has no tissue there that has to
// fit.
void Window::placeBorder(const CellLevel& coarser, bool freeInAir) noexcept
{
    const auto follow = [&](Index3 n) {
        const std::size_t node = layout.at(n.x, n.y, n.z);
        if (freeInAir && diagonal[node] > 0.0F && isAirBeyond(n, *this, coarser)) {
            return;
        }
        border[node] = open[node];
        diagonal[node] = 0.0F;
    };
    const Index3 last = size() - 1;
    for (int axis = 0; axis < 3; ++axis) {
        Index3 first(0), end = last;
        end[axis] = 0;
        volume::forEachIndex(first, end, follow);
        first[axis] = end[axis] = last[axis];
        volume::forEachIndex(first, end, follow);
    }
}

// The masks of a window without a border.
void Window::placeNodes(const CellLevel& level) noexcept
{
    std::fill(border.begin(), border.end(), 0.0F);
    for (int k = 0; k < box.z; ++k) {
        for (int j = 0; j < box.y; ++j) {
            const std::size_t from = level.nodes.offset(low + Index3(0, j, k));
            const std::size_t to = layout.at(0, j, k);
            for (std::size_t i = 0; i < static_cast<std::size_t>(layout.nx); ++i) {
                const float sum = level.diagonal[from + i];
                const bool isHeld = level.fixed[from + i] != 0, isFree = !isHeld && sum > 0.0F;
                open[to + i] = isHeld ? 0.0F : 1.0F;
                tissue[to + i] = sum > 0.0F ? 1.0F : 0.0F;
                diagonal[to + i] = isFree ? 1.0F / sum : 0.0F;
            }
        }
    }
}

void Window::placeTerm(const CellLevel& level, std::size_t i) noexcept
{
    for (int k = 0; k + 1 < box.z; ++k) {
        for (int j = 0; j + 1 < box.y; ++j) {
            const float* fraction = level.relaxing[i].data() + level.nodes.offset(low + Index3(0, j, k));
            const std::size_t to = layout.at(0, j, k);
            for (std::size_t c = 0; c + 1 < static_cast<std::size_t>(layout.nx); ++c) {
                terms[i].mu[to + c] = fraction[c] * mu[to + c];
                terms[i].lambda[to + c] = fraction[c] * lambda[to + c];
            }
            for (std::size_t c = 0; c + 1 < static_cast<std::size_t>(layout.nx) && !terms[i].layer.empty(); ++c) {
                terms[i].layer[to + c] = fraction[c] * layers.mu()[to + c];
            }
        }
    }
}

// Of fragments and virtual nodes, behind the box. Copies have no mask of their own but that of `open`.
void Window::placeFragments(const CellLevel& level, bool coarsest) noexcept
{
    fragments.place(level, low);
    layout = Layout::of(box.x, box.y, fragments.planes());
    const std::size_t begin = fragments.begin(), rest = layout.count - begin;
    for (Floats* all :
         {&mu, &lambda, &stiffening, &uncoveredMu, &uncoveredLambda, &diagonal, &border, &open, &dof, &tissue}) {
        std::fill_n(all->begin() + static_cast<std::ptrdiff_t>(begin), rest, 0.0F);
    }
    const float scale = static_cast<float>(level.nodes.spacing / 32.0);
    for (const WindowFragments::Placed& b : fragments.placed()) {
        const CellFragment& f = level.fragments.cells[b.fragment];
        mu[b.node] = uncoveredMu[b.node] = scale * f.mu;
        lambda[b.node] = uncoveredLambda[b.node] = scale * f.lambda;
        stiffening[b.node] = f.stiffening;
        cuts.set(b.node, f.cut);
    }
    for (std::size_t i = 0; i < terms.size() && !terms[i].mu.empty(); ++i) {
        std::fill_n(terms[i].mu.begin() + static_cast<std::ptrdiff_t>(begin), rest, 0.0F);
        std::fill_n(terms[i].lambda.begin() + static_cast<std::ptrdiff_t>(begin), rest, 0.0F);
        for (const WindowFragments::Placed& b : fragments.placed()) {
            const float fraction = level.fragments.cells[b.fragment].relaxing[i];
            terms[i].mu[b.node] = fraction * mu[b.node];
            terms[i].lambda[b.node] = fraction * lambda[b.node];
        }
    }
    for (const std::uint32_t f : fragments.left()) {
        keepWhole(level, level.fragments.cells[f]);
    }
    for (const WindowFragments::VirtualAt& v : fragments.virtuals()) {
        const VirtualNode& node = level.fragments.nodes[v.node];
        const bool isFree = !node.isFixed && node.diagonal > 0.0F;
        const bool follows = !coarsest && !isBetween(node.at - low, Index3(1), box - 2);
        open[v.at] = node.isFixed ? 0.0F : 1.0F;
        tissue[v.at] = 1.0F;
        border[v.at] = follows ? open[v.at] : 0.0F;
        diagonal[v.at] = isFree && !follows ? 1.0F / node.diagonal : 0.0F;
    }
    for (const WindowFragments::Copy& copy : fragments.copies()) {
        open[copy.at] = open[copy.original];
    }
}

// A fragment that found no place is one with its cell.
void Window::keepWhole(const CellLevel& level, const CellFragment& f) noexcept
{
    if (f.mu <= 0.0F) {
        return;
    }
    const float scale = static_cast<float>(level.nodes.spacing / 32.0);
    const std::size_t cell = at(f.cell);
    const float more = scale * f.mu;
    if (mu[cell] == 0.0F) {
        cuts.set(cell, f.cut);
    }
    stiffening[cell] = (mu[cell] * stiffening[cell] + more * f.stiffening) / (mu[cell] + more);
    mu[cell] += more;
    lambda[cell] += scale * f.lambda;
    uncoveredMu[cell] = mu[cell];
    uncoveredLambda[cell] = lambda[cell];
    for (std::size_t i = 0; i < terms.size() && !terms[i].mu.empty(); ++i) {
        terms[i].mu[cell] += f.relaxing[i] * more;
        terms[i].lambda[cell] += f.relaxing[i] * scale * f.lambda;
    }
    for (int c = 0; c < 8; ++c) {
        const std::size_t node = layout.corner(cell, c);
        const float own = diagonalOf(f.mu, f.lambda, level.nodes.spacing, cuts.at(cell), sideOf(c));
        if (open[node] > 0.0F && border[node] == 0.0F) {
            const float before = diagonal[node] > 0.0F ? 1.0F / diagonal[node] : 0.0F;
            diagonal[node] = 1.0F / (before + own);
            tissue[node] = 1.0F;
        }
    }
}

void Window::cover(const Window& finer) noexcept
{
    const Index3 o = finer.offsetIn(*this);
    const Index3 cells = (finer.size() - 1) / 2;
    volume::forEachIndex(o, o + cells - 1, [&](Index3 c) {
        uncoveredMu[layout.at(c.x, c.y, c.z)] = 0.0F;
        uncoveredLambda[layout.at(c.x, c.y, c.z)] = 0.0F;
        for (Term& term : terms) {
            if (!term.mu.empty()) {
                term.mu[layout.at(c.x, c.y, c.z)] = term.lambda[layout.at(c.x, c.y, c.z)] = 0.0F;
            }
        }
    });
    coverFragments(o, cells);
}

void Window::countTissue(float* around) const noexcept
{
    for (int c = 0; c < 8; ++c) {
        const std::size_t corner = layout.corner(0, c);
        for (std::size_t cell = 0; cell + corner < layout.count; ++cell) {
            around[cell + corner] += uncoveredMu[cell] > 0.0F ? 1.0F : 0.0F;
        }
    }
}

void Window::freeWhereHeld(float* held) noexcept
{
    for (std::size_t i = 0; i < layout.count; ++i) {
        dof[i] = held[i] > 0.0F && diagonal[i] > 0.0F ? 1.0F : 0.0F;
        held[i] = held[i] > 0.0F ? border[i] : 0.0F;
    }
}

void Window::coverFragments(Index3 first, Index3 cells) noexcept
{
    for (const WindowFragments::Placed& b : fragments.placed()) {
        const Index3 c = b.cell - low;
        const float left = isBetween(c, first, first + cells - 1) ? 0.0F : 1.0F;
        uncoveredMu[b.node] *= left;
        uncoveredLambda[b.node] *= left;
        for (std::size_t i = 0; i < terms.size() && !terms[i].mu.empty(); ++i) {
            terms[i].mu[b.node] *= left;
            terms[i].lambda[b.node] *= left;
        }
    }
}

}  // namespace palpate::chainmail
