#pragma once

#include <chainmail/elastic_body.h>
#include <volume/distance.h>
#include <volume/label_image.h>
#include <volume/tissue.h>
#include <volume/tissue_table.h>

#include <array>
#include <cstdint>

namespace palpate::tests {

/// A body of voxels of 1 mm as a session makes it: materials and surface from the label map. `label(p)` is 0 for air, 1 for
/// soft tissue and 2 for a board that is held [m].
template <typename Label>
chainmail::ElasticBody voxelBody(Index3 size, Vec3 low, double spacing, const Label& label)
{
    volume::TissueTable table;
    table.rows.resize(3);
    table.name = "block";
    const auto set = [&](std::size_t row, const char* name, volume::Role role, double e) {
        table.rows[row].name = name;
        table.rows[row].role = role;
        table.rows[row].youngsModulus = e;
        table.rows[row].poissonRatio = 0.45;
        table.rows[row].fixed = role == volume::Role::bone;
    };
    set(0, "air", volume::Role::air, 0.0);
    set(1, "soft", volume::Role::plain, 1e4);
    set(2, "board", volume::Role::bone, 1e4);
    volume::LabelImage image{size, {}, {}};
    image.affine.linear = Mat3(1e-3);
    image.affine.origin = low + 0.5e-3;
    image.values.assign(image.offset({0, 0, image.size.z}), 0);
    volume::forEachIndex(Index3(0), size - 1, [&](Index3 v) {
        image.values[image.offset(v)] = static_cast<std::uint16_t>(label(image.affine.toPatient(Vec3(v))));
    });
    const std::array<volume::LabelName, 2> names{{{1, "soft", "soft"}, {2, "board", "board"}}};
    const auto tissue = volume::Tissue::fromLabels(image, table, names, {});
    const auto grid = volume::coveringGrid(tissue.box(), spacing, 2.0 * spacing);
    const auto surface = tissue.distanceToBody(volume::coveringGrid(tissue.box(), 1e-3, 4e-3));
    return chainmail::elasticBody(grid, tissue.materialOn(grid, surface), surface, 0.49);
}

}  // namespace palpate::tests
