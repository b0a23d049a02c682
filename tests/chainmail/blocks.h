#pragma once

#include <chainmail/lattice.h>

#include <functional>
#include <random>

namespace palpate::tests {

/// Tissue rows: 1 is soft, 2 stiff, 3 fixed. Limits as shares of the rest length.
struct TwoMaterials {
    double softCompress = 0.5, softStretch = 1.5, softShear = 0.5;
    double stiffCompress = 0.95, stiffStretch = 1.05, stiffShear = 0.05;
};

inline volume::TissueTable tableOf(const TwoMaterials& m)
{
    volume::TissueTable table;
    table.rows.resize(4);
    const auto set = [&](std::size_t row, double compress, double stretch, double shear) {
        table.rows[row].compress = compress;
        table.rows[row].stretch = stretch;
        table.rows[row].shear = shear;
    };
    set(0, 1, 1, 0);
    set(1, m.softCompress, m.softStretch, m.softShear);
    set(2, m.stiffCompress, m.stiffStretch, m.stiffShear);
    set(3, 1, 1, 0);
    table.rows[3].fixed = true;
    return table;
}

/// A block of n^3 nodes, 1 m apart, inside a layer of nothing; `row` gives the tissue of each node, counted from 0.
inline chainmail::Lattice block(int n, const TwoMaterials& materials, const std::function<int(Index3)>& row)
{
    const volume::NodeGrid grid{Index3(n + 2), Vec3(-1.0), 1.0};
    std::vector<std::uint8_t> tissue(grid.count(), 0);
    for (std::size_t i = 0; i < tissue.size(); ++i) {
        const Index3 at = grid.node(i) - Index3(1);
        if (at.x >= 0 && at.y >= 0 && at.z >= 0 && at.x < n && at.y < n && at.z < n) {
            tissue[i] = static_cast<std::uint8_t>(row(at));
        }
    }
    return {grid, std::move(tissue), tableOf(materials)};
}

inline chainmail::Node nodeAt(const chainmail::Lattice& lattice, Index3 at)
{
    return static_cast<chainmail::Node>(lattice.grid.offset(at + Index3(1)));
}

}  // namespace palpate::tests
