#pragma once

#include <volume/geometry.h>
#include <volume/scalar_field.h>

#include <algorithm>
#include <cmath>

// Inside volume/ only.
namespace palpate::volume {

/// What a body's surface makes of the stiffness of a cell of which the voxels fill a part. The surface is smooth: the steps
/// of voxels are not felt.
///
/// Samples between voxels give the outer side of a face a part of the tissue of the inner one. A cell that is more filled
/// than the surface says is emptied to that if the surface is to be trusted: where it is that of a part of over two voxels,
/// or where it fills the cell as the faces of the voxels do. Elsewhere a cell is as full as these say.
class SurfaceCells {
public:
    /// @param surface  of the body; must outlive it
    /// @param cells    of which scale() is asked
    /// @param voxels   affine of the volume
    SurfaceCells(const DistanceField& surface, const NodeGrid& cells, const Affine& voxels);

    /// Factor of the stiffness of a cell.
    /// @param middle       of the cell [m]
    /// @param filled       part of it that voxels fill, by samples between them
    /// @param insideFaces  called for the part that their faces enclose, at most once
    template <typename InsideFaces>
    double scale(Vec3 middle, double filled, const InsideFaces& insideFaces) const
    {
        const double distance = surface_.at(middle);
        if (filled < least || std::abs(distance) > 0.9 * edge_) {
            return 1.0;
        }
        double wanted = behind(middle);
        if (wanted < filled && !isThickAt(middle, distance)) {
            const double faces = insideFaces();
            wanted = std::abs(wanted - faces) < leastNoise_ ? wanted : std::max(wanted, faces);
        }
        if (wanted < filled) {
            wanted = wanted < blur ? 0.0 : std::max(wanted, std::min(filled, sliver));
        }
        const double more = wanted - filled;
        const double trust = std::clamp(3.0 - 2.0 * std::abs(more) / noise_, 0.0, 1.0);
        return 1.0 + trust * more / filled;
    }

private:
    static constexpr double least = 1e-6;   // fraction of a cell that may be none
    static constexpr double sliver = 0.25;  // no emptier cell is made softer, since its solution would need many cycles
    static constexpr double blur = 0.02;    // with less behind the surface, tissue comes from samples between voxels alone

    // Fraction of a cell behind the surface: the mean of 4^3 parts, each from empty to full over its edge.
    double behind(Vec3 middle) const;
    // Whether the surface is that of a part of over two voxels.
    bool isThickAt(Vec3 middle, double distance) const;

    const DistanceField& surface_;
    Mat3 voxels_;        // their edges [m]
    double edge_;        // of a cell [m]
    double noise_;       // what the steps of voxels do to a fraction
    double leastNoise_;  // the same along their shortest edge
};

}  // namespace palpate::volume
