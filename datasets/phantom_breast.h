#pragma once

#include <datasets/phantom_parts.h>

namespace palpate::datasets {

/// The outer shape of the breast phantom and the layers behind it [mm]. x to the left, y to the back, z to the head; the
/// middle of the chest wall's front is at y = 0.
struct BreastShape {
    double radius = 56;      // of the breast's foot on the chest
    double projection = 45;  // of the apex in front of the foot
    double skin = 1.75;
    std::uint64_t seed = 1;
    Vec3 apex{0.0};  // under the nipple

    /// Front of the pectoral muscle.
    double muscleFront(double x, double z) const noexcept;
    /// Front of the skin, the nipple left out.
    double skinFront(double x, double z) const noexcept;
};

BreastShape makeBreastShape(const PhantomValues& values);

/// Skin and depth over the columns of the body. depth() is exact to first order: right near the skin, a little more than
/// the true distance deep inside.
struct SurfaceColumn {
    double skinFront = 0;    // [mm]
    double muscleFront = 0;  // [mm]
    double steepness = 1;    // cosine between the surface's normal and -y
    double depth(double y) const noexcept { return (y - skinFront) * steepness; }
};
SurfaceColumn surfaceColumn(const BreastShape& shape, double x, double z) noexcept;

/// Where the tumours are, each irregular, none nearer than its clearance to another or to the muscle. Throws
/// std::runtime_error when they do not fit.
std::vector<Lump> placeTumours(const BreastShape& shape, const PhantomValues& values);

/// What is neither vessel nor tumour at a point inside the breast: fat, gland, ligament.
class BreastInterior {
public:
    BreastInterior(const BreastShape& shape, double density);

    bool gland(Vec3 p, const SurfaceColumn& column) const noexcept { return glandScore(p, column) > threshold_; }
    bool ligament(Vec3 p, const SurfaceColumn& column) const noexcept;
    const std::vector<Vec3>& lobes() const noexcept { return lobes_; }

private:
    double glandScore(Vec3 p, const SurfaceColumn& column) const noexcept;

    const BreastShape& shape_;
    std::vector<Vec3> lobes_;  // unit vectors in the plane across the nipple's axis
    double threshold_ = 0;     // of glandScore(), so that gland fills the share asked for
};

/// Ducts, artery and vein. They keep clear of the tumours and of each other.
struct BreastTrees {
    std::vector<Tube> ducts, artery, vein;
};
BreastTrees growBreastTrees(const BreastShape& shape, const BreastInterior& interior, const std::vector<Lump>& tumours,
                            bool vessels);

}  // namespace palpate::datasets
