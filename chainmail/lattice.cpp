#include <chainmail/lattice.h>

#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cassert>

namespace palpate::chainmail {

Lattice::Lattice(const volume::NodeGrid& nodes, std::vector<std::uint8_t> tissueOfNodes, const volume::TissueTable& table)
    : grid(nodes), tissue(std::move(tissueOfNodes)), rows(table.rows.size())
{
    assert(tissue.size() == grid.count() && grid.count() < 0xFFFFFFFF);
    for (Node n = 0; n < tissue.size(); ++n) {
        const Index3 at = grid.node(n);
        if (glm::any(glm::equal(at, Index3(0))) || glm::any(glm::equal(at, grid.size - Index3(1)))) {
            tissue[n] = 0;
        }
    }
    const auto x = static_cast<Node>(1);
    const auto y = static_cast<Node>(grid.size.x);
    const auto z = static_cast<Node>(grid.size.x) * static_cast<Node>(grid.size.y);
    step = {0 - x, x, 0 - y, y, 0 - z, z};
    for (const auto& row : table.rows) {
        fixed.push_back(row.fixed ? 1 : 0);
    }
    const auto mean = [&](double a, double b) { return static_cast<float>(0.5 * (a + b) * grid.spacing); };
    for (const auto& a : table.rows) {
        for (const auto& b : table.rows) {
            limits.push_back(
                {mean(1.0 - a.compress, 1.0 - b.compress), mean(a.stretch - 1.0, b.stretch - 1.0), mean(a.shear, b.shear)});
        }
    }
}

}  // namespace palpate::chainmail
