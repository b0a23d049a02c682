#include <chainmail/window_stack.h>

#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>

namespace palpate::chainmail {

namespace {

// Nodes between where a window is and where it should be at which it moves: it moves by steps of two, so that coarse nodes
// stay nodes, and a hand that trembles between two places should not move it.
constexpr double slack = 1.3;

// The first window whose border is free where nothing but air is beyond it. On finer ones few cycles come nearer to the
// force with a border that follows.
constexpr std::size_t firstFreeInAir = 2;

constexpr std::array displacements{Field::u, Field::d};

// A window is as deep as asked for and half as wide again: what a tool moves spreads along the surface. Along x it is as
// wide as whole vectors allow at about the same cost.
Index3 windowSize(int depth, const Focus& focus) noexcept
{
    const Vec3 in = glm::abs(focus.inward);
    const int axis = in.x > in.y && in.x > in.z ? 0 : in.y >= in.z ? 1 : 2;
    const int width = (3 * depth / 2) | 1;
    constexpr int lanes = static_cast<int>(Layout::lanes);
    Index3 size(std::max(lanes, (width + lanes / 2 + 2) / lanes * lanes) - 1, width, width);
    size[axis] = depth;
    return size;
}

}  // namespace

Focus focusAt(const volume::DistanceField& surface, Vec3 point) noexcept
{
    return {point, -surface.normal(point), std::max(0.0, -surface.distance(point))};
}

WindowStack::WindowStack(const ElasticBody& body, int window, const Focus& focus, const Kernels& kernels)
    : body_(&body), kernels_(&kernels)
{
    std::size_t scratch = 0;
    const Index3 wanted = windowSize(window, focus);
    for (const auto& level : body.levels) {
        windows_.emplace_back(level, glm::min(level.nodes.size, wanted), body.relaxes);
        scratch = std::max(scratch, windows_.back().layout.scratchSize());
    }
    scratch_.assign(scratch, 0.0F);
    low_.assign(windows_.size(), Index3(0));
    oldLow_ = low_;
    oldCount_.assign(windows_.size(), 0);
    for (std::size_t l = 0; l < windows_.size(); ++l) {
        low_[l] = wantedLow(l, focus);
    }
    place();
}

// Lowest node of a window around the focus, as far as the grid has nodes; not rounded. Cells that the surface runs through
// have nodes outside of the body. On the border of a window, which is held, they would hold the surface: so the border
// stays a node and a half off them, which leaves one when the window is a `slack` off its place.
Vec3 WindowStack::wantedPlace(std::size_t level, const Focus& focus) const noexcept
{
    constexpr double off = 1.5;
    constexpr double onNode = 0.05;  // as near to a node as that, a surface has none outside
    const auto& grid = body_->levels[level].nodes;
    const Index3 size = windows_[level].size();
    // Half of a window less what lies between surface and focus.
    const double half = 0.5 * (std::min({size.x, size.y, size.z}) - 1) - off;
    const double shift = std::max(0.0, half - focus.depth / grid.spacing);
    const Vec3 at = (focus.point - grid.origin) / grid.spacing;
    const Vec3 surface = at - focus.depth / grid.spacing * focus.inward;
    Vec3 low = at + shift * focus.inward - 0.5 * Vec3(size - 1);
    for (int i = 0; i < 3 && shift > 0.0; ++i) {
        if (focus.inward[i] > 0.0) {
            low[i] = std::min(low[i], std::floor(surface[i] + onNode) - off);
        } else if (focus.inward[i] < 0.0) {
            low[i] = std::max(low[i], std::ceil(surface[i] - onNode) + off - (size[i] - 1));
        }
    }
    return glm::clamp(low, Vec3(0.0), Vec3(grid.size - size));
}

Index3 WindowStack::wantedLow(std::size_t level, const Focus& focus) const noexcept
{
    const Index3 low = 2 * Index3(glm::round(0.5 * wantedPlace(level, focus)));
    return glm::clamp(low, Index3(0), body_->levels[level].nodes.size - windows_[level].size());
}

void WindowStack::place() noexcept
{
    // A window must lie in the next coarser one.
    for (std::size_t l = 0; l + 1 < windows_.size(); ++l) {
        const Index3 size = windows_[l].size();
        const Index3 coarse = windows_[l + 1].size();
        const Index3 last = body_->levels[l + 1].nodes.size - coarse;
        const Index3 need = glm::max(low_[l] / 2 + (size - 1) / 2 - coarse + 1, Index3(0));
        const Index3 most = glm::min(low_[l] / 2, last);
        low_[l + 1] = glm::clamp(low_[l + 1], need, most);
        if (l + 2 < windows_.size()) {
            // Even, so that it has nodes in common with the next: up, or down where up is too far.
            low_[l + 1] += low_[l + 1] % 2;
            low_[l + 1] -= 2 * Index3(glm::greaterThan(low_[l + 1], most));
        }
    }
    bool finerMoves = false;
    for (std::size_t l = 0; l < windows_.size(); ++l) {
        Window& w = windows_[l];
        const bool moves = w.low != low_[l];
        if (moves || finerMoves) {
            const CellLevel* coarser = l + 1 < windows_.size() ? &body_->levels[l + 1] : nullptr;
            w.place(body_->levels[l], low_[l], coarser, l >= firstFreeInAir);
            if (l > 0) {
                w.cover(windows_[l - 1]);
            }
        }
        finerMoves = moves;
    }
    for (std::size_t l = 0; l + 1 < windows_.size(); ++l) {
        const Window& coarse = windows_[l + 1];
        windows_[l].fragments.link(body_->levels[l], windows_[l].low, coarse.layout, coarse.low, body_->levels[l + 1],
                                   coarse.fragments);
    }
    findFreedom();
}

// A node is held by the cells around it that no finer window covers, and by what follows it on the next finer window's
// border, if that is held itself: over the surface borders lie over each other, and there may be no such cell in any of
// them. Without being held a node is no degree of freedom: contacts would carry it away. Marks are counts and
// eighths of 1, which are exact in whatever order they are added.
void WindowStack::findFreedom() noexcept
{
    for (std::size_t l = 0; l < windows_.size(); ++l) {
        Window& w = windows_[l];
        std::memset(w.field(Field::t), 0, 3 * w.layout.count * sizeof(float));
        w.countTissue(w.field(Field::t));
        w.collect(Field::t);
        if (l > 0) {
            restrictAdd(*kernels_, windows_[l - 1], windows_[l - 1].field(Field::t), w, w.field(Field::t), scratch());
        }
        w.freeWhereHeld(w.field(Field::t));
    }
}

bool WindowStack::follow(const Focus& focus, bool carry) noexcept
{
    bool moves = false;
    for (std::size_t l = 0; l < windows_.size(); ++l) {
        oldLow_[l] = low_[l];
        oldCount_[l] = windows_[l].layout.count;
        const Vec3 off = glm::abs(wantedPlace(l, focus) - Vec3(low_[l]));
        const Index3 wanted = wantedLow(l, focus);
        if (std::max({off.x, off.y, off.z}) > slack && wanted != low_[l]) {
            low_[l] = wanted;
            moves = true;
        }
    }
    if (!moves) {
        return false;
    }
    if (carry) {
        for (std::size_t l = 0; l + 1 < windows_.size(); ++l) {
            inject(windows_[l], windows_[l + 1], displacements);
        }
    }
    const bool remembers = carry && body_->relaxes;
    for (std::size_t i = 0; i < volume::relaxationTerms && remembers; ++i) {
        gatherForces(history(i));
    }
    place();
    dropFields(carry);
    if (carry) {
        for (const Field f : displacements) {
            transfer(f);
        }
    }
    for (std::size_t i = 0; i < volume::relaxationTerms && remembers; ++i) {
        handOutForces(history(i));
    }
    if (remembers) {
        combine(history(0), 1.0, history(1), Field::h);
    }
    return true;
}

// Where a window has got another layout, nothing but what is carried over means anything.
void WindowStack::dropFields(bool carry) noexcept
{
    for (std::size_t l = 0; l < windows_.size(); ++l) {
        for (std::size_t f = 0; f < fieldCount && windows_[l].layout.count != oldCount_[l]; ++f) {
            const bool isKept = carry && (Field(f) == Field::u || Field(f) == Field::d || Field(f) >= Field::h);
            if (!isKept) {
                std::ranges::fill(windows_[l].fields[f], 0.0F);
            }
        }
    }
}

// Adds to every window what all finer ones hold, so that each has the whole force.
void WindowStack::gatherForces(Field field) noexcept
{
    for (std::size_t l = 0; l + 1 < windows_.size(); ++l) {
        restrictAdd(*kernels_, windows_[l], windows_[l].field(field), windows_[l + 1], windows_[l + 1].field(field),
                    scratch());
    }
}

// The other way round, at the windows' new places: every window keeps what it had there and what no finer one has. What is
// left over under a finer window, where that was not before, goes down to it node by node. So the work along any
// displacement that the coarser window has too stays what it was.
void WindowStack::handOutForces(Field field) noexcept
{
    for (std::size_t l = 0; l < windows_.size(); ++l) {
        Window& w = windows_[l];
        std::memset(w.field(Field::t), 0, 3 * w.layout.count * sizeof(float));
        carryOver(w, oldLow_[l], oldCount_[l], w.field(field), w.field(Field::t));
        float* finer = w.field(Field::f);  // what finer windows have
        if (l == 0) {
            std::memset(finer, 0, 3 * w.layout.count * sizeof(float));
        }
        kernels_->combine(w.field(Field::t), -1.0F, finer, w.field(field), 3 * w.layout.count);
        keepWhereFree(w, w.field(field));
        if (l + 1 < windows_.size()) {
            Window& coarse = windows_[l + 1];
            std::memset(coarse.field(Field::f), 0, 3 * coarse.layout.count * sizeof(float));
            kernels_->combine(finer, 1.0F, w.field(field), finer, 3 * w.layout.count);
            restrictAdd(*kernels_, w, finer, coarse, coarse.field(Field::f), scratch());
        }
    }
    for (std::size_t l = windows_.size() - 1; l-- > 0;) {
        handDown(windows_[l + 1], field, windows_[l]);
    }
    for (Window& w : windows_) {
        kernels_->smoothFirst(1.0F, w.dof.data(), w.field(field), w.field(field), w.layout.count);
    }
}

void WindowStack::transfer(Field field) noexcept
{
    for (std::size_t l = windows_.size(); l-- > 0;) {
        Window& w = windows_[l];
        if (w.low == oldLow_[l]) {
            continue;
        }
        std::memset(w.field(Field::t), 0, 3 * w.layout.count * sizeof(float));
        if (l + 1 < windows_.size()) {
            prolong(*kernels_, windows_[l + 1], windows_[l + 1].field(field), w, w.field(Field::t));
        }
        carryOver(w, oldLow_[l], oldCount_[l], w.field(field), w.field(Field::t));
        // What is held here may have been free in the coarser window's cells.
        kernels_->smoothFirst(1.0F, w.open.data(), w.field(Field::t), w.field(Field::t), w.layout.count);
        w.share(Field::t);
        w.fields[static_cast<std::size_t>(field)].swap(w.fields[static_cast<std::size_t>(Field::t)]);
    }
}

void WindowStack::joinBorders(Field x) noexcept
{
    for (std::size_t l = windows_.size() - 1; l-- > 0;) {
        Window& w = windows_[l];
        prolong(*kernels_, windows_[l + 1], windows_[l + 1].field(x), w, w.field(Field::t));
        kernels_->blend(w.border.data(), w.field(Field::t), w.field(x), w.layout.count);
        w.share(x);
    }
}

WindowStack::Evaluated WindowStack::evaluate(Field x, Field y, Field along, const volume::Law& law,
                                             std::optional<std::size_t> term) noexcept
{
    const Kernels& k = *kernels_;
    Evaluated sum;
    for (std::size_t l = 0; l < windows_.size(); ++l) {
        Window& w = windows_[l];
        CellStiffness stiffness = term ? w.term(*term) : w.uncovered();
        stiffness.law = law.index();
        if (!volume::isSmall(law)) {
            const float inverse = static_cast<float>(1.0 / body_->levels[l].nodes.spacing);
            sum.energy += k.applyFinite(w.layout, stiffness, inverse, w.field(x), w.field(y), scratch());
        } else {
            k.apply(w.layout, stiffness, w.field(x), w.field(y), scratch());
        }
        w.collect(y);
    }
    for (std::size_t l = 0; l < windows_.size(); ++l) {
        Window& w = windows_[l];
        if (l + 1 < windows_.size()) {
            k.smoothFirst(1.0F, w.border.data(), w.field(y), w.field(Field::t), w.layout.count);
            restrictAdd(k, w, w.field(Field::t), windows_[l + 1], windows_[l + 1].field(y), scratch());
        }
        sum.product += k.negate(w.dof.data(), w.field(along), w.field(y), w.layout.count);
    }
    return sum;
}

void WindowStack::addToParents(std::size_t level, std::size_t node, Vec3 force) noexcept
{
    windows_[level].visitParents(node, windows_[level + 1], [&](std::size_t parent, double fraction) {
        addForce(level + 1, parent, fraction * force);
    });
}

std::array<double, 2> WindowStack::dots(Field x, Field a, Field b) const noexcept
{
    std::array<double, 2> sum{};
    for (const Window& w : windows_) {
        std::array<double, 2> part{};
        kernels_->dots(w.field(x), w.field(a), w.field(b), 3 * w.layout.count, part.data());
        sum[0] += part[0];
        sum[1] += part[1];
    }
    return sum;
}

Vec3 WindowStack::alongSlopes(Field r, Field u) const noexcept
{
    const Window& w = windows_.front();
    const Layout& l = w.layout;
    const float *along = w.field(r), *of = w.field(u), *tissue = w.tissue.data();
    Vec3 sum(0.0);
    for (std::size_t c = 0; c < 3 * l.count; c += l.count) {
        sum.x += kernels_->alongSlope(tissue, along + c, of + c, 1, l.count);
        sum.z += kernels_->alongSlope(tissue, along + c, of + c, l.plane, l.count - l.plane);
        for (std::size_t at = 0; at < l.count; at += l.plane) {
            sum.y += kernels_->alongSlope(tissue + at, along + c + at, of + c + at, l.row, l.plane - l.row);
        }
    }
    return sum / body_->levels.front().nodes.spacing;
}

void WindowStack::combine(Field x, double a, Field y, Field out) noexcept
{
    for (Window& w : windows_) {
        kernels_->combine(w.field(x), static_cast<float>(a), w.field(y), w.field(out), 3 * w.layout.count);
    }
}

StepFields WindowStack::stepFields(Window& w, Field direction) noexcept
{
    return {w.field(Field::u),  w.field(Field::a), w.field(Field::d), w.field(Field::e),
            w.field(direction), w.field(Field::q), w.field(Field::r)};
}

void WindowStack::warmStart(double step) noexcept
{
    for (Window& w : windows_) {
        kernels_->warmStart(static_cast<float>(step), stepFields(w, Field::d), 3 * w.layout.count);
    }
}

void WindowStack::direct(Field last, double beta, double step) noexcept
{
    for (Window& w : windows_) {
        kernels_->direct(w.field(Field::z), static_cast<float>(beta), w.field(last), static_cast<float>(step),
                         stepFields(w, Field::p), 3 * w.layout.count);
    }
}

std::array<double, 3> WindowStack::keepStep(Field direction, const KeptStep& step) noexcept
{
    std::array<double, 3> sum{};
    for (Window& w : windows_) {
        std::array<double, 3> part{};
        kernels_->keepStep(step, w.field(Field::f), stepFields(w, direction), 3 * w.layout.count, part.data());
        for (std::size_t i = 0; i < sum.size(); ++i) {
            sum[i] += part[i];
        }
    }
    return sum;
}

void WindowStack::copy(Field x, Field y) noexcept
{
    for (Window& w : windows_) {
        std::memcpy(w.field(y), w.field(x), 3 * w.layout.count * sizeof(float));
    }
}

void WindowStack::clear(Field field) noexcept
{
    for (Window& w : windows_) {
        std::memset(w.field(field), 0, 3 * w.layout.count * sizeof(float));
    }
}

}  // namespace palpate::chainmail
