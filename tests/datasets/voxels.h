#pragma once

#include <base/cells.h>
#include <volume/tissue.h>

#include <cstdint>
#include <string>
#include <vector>

namespace palpate::datasets {

/// The labels of a Tissue as a dense array again, for tests that count voxels. x runs fastest.
struct Voxels {
    explicit Voxels(const volume::Tissue& tissue) : size(tissue.size()), edge(tissue.affine().spacing().x)
    {
        const volume::Tissue::Reader reader(tissue);
        values.reserve(base::countOf(size));
        for (int k = 0; k < size.z; ++k) {
            for (int j = 0; j < size.y; ++j) {
                for (int i = 0; i < size.x; ++i) {
                    values.push_back(reader.label(tissue.affine().toPatient(Vec3(i, j, k))));
                }
            }
        }
    }

    bool contains(Index3 n) const { return base::holds(size, n); }
    std::size_t offset(Index3 n) const { return base::offsetOf(size, n); }
    std::uint16_t at(Index3 n) const { return values[offset(n)]; }

    template <class Visit>
    void forEach(Visit visit) const
    {
        for (int k = 0; k < size.z; ++k) {
            for (int j = 0; j < size.y; ++j) {
                for (int i = 0; i < size.x; ++i) {
                    visit(Index3(i, j, k), at({i, j, k}));
                }
            }
        }
    }
    template <class Visit>
    void forEachNeighbour(Index3 n, Visit visit) const
    {
        for (int side = 0; side < 6; ++side) {
            Index3 next = n;
            next[side / 2] += side % 2 == 0 ? 1 : -1;
            if (contains(next)) {
                visit(next);
            }
        }
    }

    Index3 size;
    double edge;  // [m]
    std::vector<std::uint16_t> values;
};

inline const volume::Structure* structureNamed(const volume::Tissue& tissue, const std::string& name)
{
    for (const volume::Structure& s : tissue.structures()) {
        if (s.name == name) {
            return &s;
        }
    }
    return nullptr;
}

}  // namespace palpate::datasets
