// What goes between windows, and from where a window was to where it is.
#include <chainmail/window.h>

#include <glm/common.hpp>

#include <algorithm>
#include <cstring>

namespace palpate::chainmail {

namespace {

// Of virtual nodes of a coarse window the nodes of a finer one that follow them, with shares that add up to 1: the one at
// the same place alone where there is one, and else all. Most virtual nodes lie in the gap. Uses up Field::t of the coarse
// window.
class Followers {
public:
    Followers(const Window& fine, Window& coarse) noexcept
        : fine_(fine), begin_(coarse.fragments.begin()), sums_(coarse.field(Field::t))
    {
        forEachLink([&](std::size_t parent, std::size_t, float) { sums_[parent] = 0.0F; });
        forEachLink([&](std::size_t parent, std::size_t, float weight) { sums_[parent] += weight; });
    }
    /// Calls visit(parent, node, share); `parent` is a node of the box where one of the finer window's fragments is there.
    template <typename Visit>
    void forEachParent(Visit&& visit) const noexcept
    {
        forEachLink([&](std::size_t parent, std::size_t node, float weight) {
            visit(parent, node, static_cast<double>(weight / sums_[parent]));
        });
    }

private:
    template <typename Visit>
    void forEachLink(Visit&& visit) const noexcept
    {
        constexpr float alone = 1e6F;
        for (const WindowFragments::Link& link : fine_.fragments.links()) {
            const float weight = link.count == 1 ? alone : 1.0F / static_cast<float>(link.count);
            for (std::size_t i = 0; i < link.count; ++i) {
                if (link.parents[i] >= begin_ || link.count == 1) {
                    visit(link.parents[i], link.node, weight);
                }
            }
        }
    }

    const Window& fine_;
    std::size_t begin_;
    float* sums_;  // of the weights of each
};

// The nodes that do not follow the coarse window as their places have it; one component.
void followLinks(const Window& fine, const float* from, float* to) noexcept
{
    for (const WindowFragments::Link& link : fine.fragments.links()) {
        float sum = 0.0F;
        for (std::size_t i = 0; i < link.count; ++i) {
            sum += from[link.parents[i]];
        }
        to[link.node] = sum / static_cast<float>(link.count);
    }
}

// The transpose: what went to the nodes of the place goes to those that are followed.
void giveToParents(const Window& fine, const float* from, const Window& coarse, float* to) noexcept
{
    for (const WindowFragments::Link& link : fine.fragments.links()) {
        const float share = from[link.node] / static_cast<float>(link.count);
        for (std::size_t i = 0; i < link.count; ++i) {
            to[link.parents[i]] += share;
        }
        if (link.node < fine.fragments.begin()) {
            fine.visitParentsByPlace(link.node, coarse, [&](std::size_t parent, double) { to[parent] -= share; });
        }
    }
}

}  // namespace

void prolong(const Kernels& k, const Window& coarse, const float* from, const Window& fine, float* to) noexcept
{
    const Index3 o = fine.offsetIn(coarse);
    const Layout& l = fine.layout;
    for (std::size_t c = 0; c < 3; ++c) {
        const float* source = from + c * coarse.layout.count;
        float* target = to + c * l.count;
        for (int z = 0; z < fine.box.z; z += 2) {
            for (int y = 0; y < l.ny; y += 2) {
                k.spread(source + coarse.layout.at(o.x, o.y + y / 2, o.z + z / 2), l.nx, target + l.at(0, y, z));
            }
            for (int y = 1; y < l.ny; y += 2) {
                k.average(target + l.at(0, y - 1, z), target + l.at(0, y + 1, z), target + l.at(0, y, z), l.row);
            }
        }
        for (int z = 1; z < fine.box.z; z += 2) {
            k.average(target + l.at(0, 0, z - 1), target + l.at(0, 0, z + 1), target + l.at(0, 0, z), l.plane);
        }
        followLinks(fine, source, target);
    }
}

void restrictAdd(const Kernels& k, const Window& fine, const float* from, const Window& coarse, float* to,
                 float* scratch) noexcept
{
    const Index3 o = fine.offsetIn(coarse);
    const Layout& l = fine.layout;
    float* zeros = scratch;
    float* sum = scratch + l.plane;
    float* rows = scratch + 2 * l.plane + Layout::lanes;
    std::memset(zeros, 0, l.plane * sizeof(float));
    rows[-1] = 0.0F;
    for (std::size_t c = 0; c < 3; ++c) {
        const float* source = from + c * l.count;
        float* target = to + c * coarse.layout.count;
        for (int z = 0; z < fine.box.z; z += 2) {
            const float* below = z > 0 ? source + l.at(0, 0, z - 1) : zeros;
            const float* above = z + 1 < fine.box.z ? source + l.at(0, 0, z + 1) : zeros;
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
        giveToParents(fine, source, coarse, target);
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
    const Index3 o = fine.offsetIn(coarse);
    const Index3 last = (fine.size() - 1) / 2;
    volume::forEachIndex(Index3(0), last, [&](Index3 n) {
        const bool inside = isBetween(n, Index3(1), last - 1);
        if (!inside && coarse.anyUncovered(o + n - 1, o + n)) {
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
    Followers followers(fine, coarse);
    followers.forEachParent([&](std::size_t parent, std::size_t node, double share) {
        if (parent >= coarse.fragments.begin() && coarse.dof[parent] == 0.0F && fine.diagonal[node] > 0.0F) {
            fine.add(field, node, share * coarse.value(field, parent));
        }
    });
}

namespace {

// Which nodes move tissue: by how much, at the middle of a cell's tissue, over that in a full cell. In Field::t: 1 or 0,
// and besideGap as markGaps() has it.
float* markHolding(Window& w) noexcept
{
    constexpr float least = 0.1F;
    float* holds = w.field(Field::t);
    std::fill_n(holds, w.layout.count, 0.0F);
    volume::forEachIndex(Index3(0), w.box - 2, [&](Index3 cell) {
        const std::size_t at = w.layout.at(cell.x, cell.y, cell.z);
        if (w.mu[at] <= 0.0F) {
            return;
        }
        const bool isWhole = w.cuts.filling()[at / Layout::lanes] != Filling::cut;
        for (int c = 0; c < 8; ++c) {
            const Vec3f share = isWhole ? Vec3f(1.0F) : 1.0F + sideOf(c) * w.cuts.at(at).middle;
            if (share.x * share.y * share.z >= least) {
                holds[w.layout.corner(at, c)] = 1.0F;
            }
        }
    });
    return holds;
}

constexpr float besideGap = -1.0F;

// Marks the nodes of a window that lie within a node of the fragments of `w`: that window, or the next coarser one, of
// which it begins at node `offset`.
void markGaps(const Window& w, int nodesPerCell, Index3 offset, const Window& fine, float* holds) noexcept
{
    for (const WindowFragments::Placed& p : w.fragments.placed()) {
        const Index3 low = nodesPerCell * (p.cell - w.low - offset);
        volume::forEachIndex(glm::max(low - 1, Index3(0)), glm::min(low + nodesPerCell + 1, fine.box - 1),
                             [&](Index3 n) { holds[fine.layout.at(n.x, n.y, n.z)] = besideGap; });
    }
}

// What the tissue beside a node does, in a straight line up to the node; what the node itself does where there is none.
Vec3 continued(const Window& w, Field field, const float* holds, Index3 n) noexcept
{
    Vec3 sum(0.0);
    int lines = 0;
    volume::forEachIndex(Index3(-1), Index3(1), [&](Index3 way) {
        const Index3 near = n + way, far = near + way;
        if (way == Index3(0) || !isBetween(far, Index3(0), w.box - 1)) {
            return;
        }
        const std::size_t nearAt = w.layout.at(near.x, near.y, near.z), farAt = w.layout.at(far.x, far.y, far.z);
        if (holds[nearAt] > 0.0F && holds[farAt] > 0.0F) {
            sum += 2.0 * w.value(field, nearAt) - w.value(field, farAt);
            ++lines;
        }
    });
    return lines > 0 ? sum / static_cast<double>(lines) : w.value(field, w.layout.at(n.x, n.y, n.z));
}

}  // namespace

// Nodes that hold no tissue in the fine window, but may in the coarse one, have no displacement of their own. Beside a gap
// they keep what they have: a line would lead across it. Nothing is taken where the coarse window solves itself, as on the
// fine one's border where that follows; what it holds is at rest.
void inject(Window& fine, Window& coarse, std::span<const Field> fields) noexcept
{
    float* holds = markHolding(fine);
    const Index3 o = fine.offsetIn(coarse);
    markGaps(fine, 1, Index3(0), fine, holds);
    markGaps(coarse, 2, o, fine, holds);
    volume::forEachIndex(Index3(0), (fine.size() - 1) / 2, [&](Index3 n) {
        const std::size_t target = coarse.layout.at(o.x + n.x, o.y + n.y, o.z + n.z);
        const std::size_t source = fine.layout.at(2 * n.x, 2 * n.y, 2 * n.z);
        if (coarse.dof[target] > 0.0F) {
            return;
        }
        const bool isHeld = coarse.open[target] == 0.0F;
        const bool own = coarse.tissue[target] == 0.0F || fine.open[source] == 0.0F || holds[source] != 0.0F;
        for (const Field field : fields) {
            coarse.set(field, target,
                       isHeld ? Vec3(0.0)
                       : own  ? fine.value(field, source)
                              : continued(fine, field, holds, 2 * n));
        }
    });
    Followers followers(fine, coarse);
    for (const Field field : fields) {
        followers.forEachParent([&](std::size_t parent, std::size_t, double) { coarse.set(field, parent, Vec3(0.0)); });
        followers.forEachParent([&](std::size_t parent, std::size_t node, double share) {
            coarse.add(field, parent, share * fine.value(field, node));
        });
        coarse.share(field);
    }
}

void carryOver(const Window& window, Index3 oldLow, std::size_t oldCount, const float* from, float* to) noexcept
{
    const Layout& layout = window.layout;
    const Index3 first = glm::max(window.low, oldLow);
    const Index3 last = glm::min(window.low, oldLow) + window.box - 1;
    const std::size_t n = first.x > last.x ? 0 : static_cast<std::size_t>(last.x - first.x + 1) * sizeof(float);
    for (std::size_t c = 0; c < 3; ++c, from += oldCount, to += layout.count) {
        for (int k = first.z; k <= last.z && n > 0; ++k) {
            for (int j = first.y; j <= last.y; ++j) {
                const Index3 start(first.x, j, k);
                const Index3 a = start - oldLow;
                const Index3 b = start - window.low;
                std::memcpy(to + layout.at(b.x, b.y, b.z), from + layout.at(a.x, a.y, a.z), n);
            }
        }
        for (const WindowFragments::VirtualAt& v : window.fragments.virtuals()) {
            const std::uint32_t was = window.low == oldLow ? v.at : window.fragments.wasAt(v.node);
            if (was != noFragment) {
                to[v.at] = from[was];
            }
        }
    }
}

}  // namespace palpate::chainmail
