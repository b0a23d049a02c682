#include <chainmail/window.h>

#include <glm/common.hpp>

#include <algorithm>
#include <cstring>

namespace palpate::chainmail {

namespace {

// True when one of the cells from `first` to `last` is not empty.
bool anyTissue(const Layout& l, const Floats& mu, Index3 first, Index3 last) noexcept
{
    bool any = false;
    volume::forEachIndex(glm::max(first, Index3(0)), glm::min(last, Index3(l.nx - 2, l.ny - 2, l.nz - 2)),
                         [&](Index3 c) { any = any || mu[l.at(c.x, c.y, c.z)] > 0.0F; });
    return any;
}

Index3 offsetIn(const Window& fine, const Window& coarse) noexcept
{
    return fine.low / 2 - coarse.low;
}

}  // namespace

LayerFields::LayerFields(const Layout& layout, bool any) : layout_(layout)
{
    const std::size_t room = any ? layout.count + Layout::lanes : 0;
    mu_.assign(room, 0.0F);
    any_.assign(room / Layout::lanes, 0);
    for (std::size_t c = 0; c < 3; ++c) {
        normal_[c].assign(room, 0.0F);
        middle_[c].assign(room, 0.0F);
        half_[c].assign(room, 0.0F);
    }
}

void LayerFields::place(const CellLevel& level, Index3 at) noexcept
{
    some_ = false;
    std::fill(mu_.begin(), mu_.end(), 0.0F);
    std::fill(any_.begin(), any_.end(), std::uint8_t{0});
    const int rows = mu_.empty() ? 0 : (layout_.ny - 1) * (layout_.nz - 1);
    for (int r = 0; r < rows; ++r) {
        const Index3 first = at + Index3(0, r % (layout_.ny - 1), r / (layout_.ny - 1));
        const auto row = static_cast<std::size_t>(first.y + first.z * level.nodes.size.y);
        for (std::uint32_t i = level.layerRows[row]; i < level.layerRows[row + 1]; ++i) {
            const Index3 cell = level.layers[i].cell - at;
            if (cell.x >= 0 && cell.x + 1 < layout_.nx) {
                set(layout_.at(cell.x, cell.y, cell.z), level.layers[i], static_cast<float>(level.nodes.spacing / 32.0));
            }
        }
    }
}

void LayerFields::set(std::size_t cell, const CellLayer& layer, float scale) noexcept
{
    mu_[cell] = scale * layer.mu;
    for (int c = 0; c < 3; ++c) {
        normal_[static_cast<std::size_t>(c)][cell] = layer.normal[c];
        middle_[static_cast<std::size_t>(c)][cell] = layer.middle[c];
        half_[static_cast<std::size_t>(c)][cell] = layer.half[c];
    }
    any_[cell / Layout::lanes] = 1;
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
            any_.data()};
}

Window::Window(Index3 size, bool relaxes, bool layered)
    : layout(Layout::of(size.x, size.y, size.z)), layers(layout, layered)
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

void Window::place(const CellLevel& level, Index3 at, bool coarsest) noexcept
{
    low = at;
    const float scale = static_cast<float>(level.nodes.spacing / 32.0);
    for (int k = 0; k + 1 < layout.nz; ++k) {
        for (int j = 0; j + 1 < layout.ny; ++j) {
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
    std::copy(mu.begin(), mu.end(), uncoveredMu.begin());
    std::copy(lambda.begin(), lambda.end(), uncoveredLambda.begin());
    for (std::size_t i = 0; i < terms.size() && !terms[i].mu.empty(); ++i) {
        placeTerm(level, i);
    }
    placeNodes(level);
    if (coarsest) {
        return;
    }
    const auto follow = [&](Index3 n) {
        const std::size_t node = layout.at(n.x, n.y, n.z);
        border[node] = open[node];
        diagonal[node] = dof[node] = 0.0F;
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
    for (int k = 0; k < layout.nz; ++k) {
        for (int j = 0; j < layout.ny; ++j) {
            const std::size_t from = level.nodes.offset(low + Index3(0, j, k));
            const std::size_t to = layout.at(0, j, k);
            for (std::size_t i = 0; i < static_cast<std::size_t>(layout.nx); ++i) {
                const float sum = level.diagonal[from + i];
                const bool isHeld = level.fixed[from + i] != 0, isFree = !isHeld && sum > 0.0F;
                open[to + i] = isHeld ? 0.0F : 1.0F;
                tissue[to + i] = sum > 0.0F ? 1.0F : 0.0F;
                diagonal[to + i] = isFree ? 1.0F / sum : 0.0F;
                dof[to + i] = isFree ? 1.0F : 0.0F;
            }
        }
    }
}

void Window::placeTerm(const CellLevel& level, std::size_t i) noexcept
{
    for (int k = 0; k + 1 < layout.nz; ++k) {
        for (int j = 0; j + 1 < layout.ny; ++j) {
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

void Window::cover(const Window& finer) noexcept
{
    const Index3 o = offsetIn(finer, *this);
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
    volume::forEachIndex(o + 1, o + cells - 1, [&](Index3 n) { dof[layout.at(n.x, n.y, n.z)] = 0.0F; });
    // A node on the finer window's border may be left with nothing but empty cells around it.
    const auto pulled = [&](Index3 n) {
        if (anyTissue(layout, uncoveredMu, n - 1, n)) {
            return true;
        }
        bool any = false;
        const Index3 fine = 2 * (n - o);
        volume::forEachIndex(glm::max(fine - 1, Index3(0)), glm::min(fine + 1, finer.size() - 1), [&](Index3 m) {
            any =
                any || (finer.border[finer.layout.at(m.x, m.y, m.z)] > 0.0F && anyTissue(finer.layout, finer.mu, m - 1, m));
        });
        return any;
    };
    volume::forEachIndex(o, o + cells, [&](Index3 n) {
        float& free = dof[layout.at(n.x, n.y, n.z)];
        free = free > 0.0F && pulled(n) ? 1.0F : 0.0F;
    });
}

void prolong(const Kernels& k, const Window& coarse, const float* from, const Window& fine, float* to) noexcept
{
    const Index3 o = offsetIn(fine, coarse);
    const Layout& l = fine.layout;
    for (std::size_t c = 0; c < 3; ++c) {
        const float* source = from + c * coarse.layout.count;
        float* target = to + c * l.count;
        for (int z = 0; z < l.nz; z += 2) {
            for (int y = 0; y < l.ny; y += 2) {
                k.spread(source + coarse.layout.at(o.x, o.y + y / 2, o.z + z / 2), l.nx, target + l.at(0, y, z));
            }
            for (int y = 1; y < l.ny; y += 2) {
                k.average(target + l.at(0, y - 1, z), target + l.at(0, y + 1, z), target + l.at(0, y, z), l.row);
            }
        }
        for (int z = 1; z < l.nz; z += 2) {
            k.average(target + l.at(0, 0, z - 1), target + l.at(0, 0, z + 1), target + l.at(0, 0, z), l.plane);
        }
    }
}

void restrictAdd(const Kernels& k, const Window& fine, const float* from, const Window& coarse, float* to,
                 float* scratch) noexcept
{
    const Index3 o = offsetIn(fine, coarse);
    const Layout& l = fine.layout;
    float* zeros = scratch;
    float* sum = scratch + l.plane;
    float* rows = scratch + 2 * l.plane + Layout::lanes;
    std::memset(zeros, 0, l.plane * sizeof(float));
    rows[-1] = 0.0F;
    for (std::size_t c = 0; c < 3; ++c) {
        const float* source = from + c * l.count;
        float* target = to + c * coarse.layout.count;
        for (int z = 0; z < l.nz; z += 2) {
            const float* below = z > 0 ? source + l.at(0, 0, z - 1) : zeros;
            const float* above = z + 1 < l.nz ? source + l.at(0, 0, z + 1) : zeros;
            k.hat(below, source + l.at(0, 0, z), above, sum, l.plane);
            for (int y = 0; y < l.ny; y += 2) {
                const float* before = y > 0 ? sum + l.at(0, y - 1, 0) : zeros;
                const float* after = y + 1 < l.ny ? sum + l.at(0, y + 1, 0) : zeros;
                k.hat(before, sum + l.at(0, y, 0), after, rows + l.at(0, y / 2, 0), l.row);
            }
            // Apart from the loop above: what has just been stored cannot be loaded a lane further at once. A row's padding
            // is zero, so that it is what lies before the next one's first node.
            for (int y = 0; y < l.ny; y += 2) {
                k.gatherAdd(rows + l.at(0, y / 2, 0), l.nx, target + coarse.layout.at(o.x, o.y + y / 2, o.z + z / 2));
            }
        }
    }
}

void keepWhereFree(const Window& w, float* force) noexcept
{
    for (std::size_t c = 0; c < 3; ++c, force += w.layout.count) {
        for (std::size_t i = 0; i < w.layout.count; ++i) {
            force[i] = w.diagonal[i] > 0.0F ? force[i] : 0.0F;
        }
    }
}

void handDown(Window& coarse, Field field, Window& fine) noexcept
{
    const Index3 o = offsetIn(fine, coarse);
    const Index3 last = (fine.size() - 1) / 2;
    volume::forEachIndex(Index3(0), last, [&](Index3 n) {
        const bool inside = n == glm::clamp(n, Index3(1), last - 1);
        if (!inside && anyTissue(coarse.layout, coarse.uncoveredMu, o + n - 1, o + n)) {
            return;
        }
        const Index3 at = glm::clamp(2 * n, Index3(1), fine.size() - 2);
        const std::size_t to = fine.layout.at(at.x, at.y, at.z);
        const std::size_t from = coarse.layout.at(o.x + n.x, o.y + n.y, o.z + n.z);
        if (fine.diagonal[to] > 0.0F) {
            fine.add(field, to, coarse.value(field, from));
        }
        coarse.add(field, from, -coarse.value(field, from));
    });
}

void inject(const Window& fine, const float* from, const Window& coarse, float* to) noexcept
{
    const Index3 o = offsetIn(fine, coarse);
    volume::forEachIndex(Index3(0), (fine.size() - 1) / 2, [&](Index3 n) {
        const std::size_t target = coarse.layout.at(o.x + n.x, o.y + n.y, o.z + n.z);
        const std::size_t source = fine.layout.at(2 * n.x, 2 * n.y, 2 * n.z);
        for (std::size_t c = 0; c < 3; ++c) {
            to[c * coarse.layout.count + target] = from[c * fine.layout.count + source];
        }
    });
}

void carryOver(const Layout& layout, Index3 oldLow, const float* from, Index3 newLow, float* to) noexcept
{
    const Index3 size(layout.nx, layout.ny, layout.nz);
    const Index3 first = glm::max(newLow, oldLow);
    const Index3 last = glm::min(newLow, oldLow) + size - 1;
    if (first.x > last.x) {
        return;
    }
    const std::size_t n = static_cast<std::size_t>(last.x - first.x + 1) * sizeof(float);
    for (std::size_t c = 0; c < 3; ++c) {
        for (int k = first.z; k <= last.z; ++k) {
            for (int j = first.y; j <= last.y; ++j) {
                const Index3 start(first.x, j, k);
                const Index3 a = start - oldLow;
                const Index3 b = start - newLow;
                std::memcpy(to + c * layout.count + layout.at(b.x, b.y, b.z),
                            from + c * layout.count + layout.at(a.x, a.y, a.z), n);
            }
        }
    }
}

}  // namespace palpate::chainmail
