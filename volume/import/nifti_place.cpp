#include <volume/import/nifti.h>

#include <glm/common.hpp>

#include <cmath>

namespace palpate::volume {

namespace {

// RAS [mm] as NIfTI has it to LPS [m].
Affine toPatient(const Mat3& linear, const Vec3& origin, double unit)
{
    const Vec3 flip(-unit, -unit, unit);
    return {Mat3(linear[0] * flip, linear[1] * flip, linear[2] * flip), origin * flip};
}

Affine sform(const NiftiHeader& header, double unit)
{
    Mat3 linear;
    Vec3 origin;
    for (int row = 0; row < 3; ++row) {
        const auto r = static_cast<std::size_t>(row);
        for (int column = 0; column < 3; ++column) {
            linear[column][row] = header.srow(r, static_cast<std::size_t>(column));
        }
        origin[row] = header.srow(r, 3);
    }
    return toPatient(linear, origin, unit);
}

Affine qform(const NiftiHeader& header, double unit)
{
    const double b = header.quaternion(0);
    const double c = header.quaternion(1);
    const double d = header.quaternion(2);
    const double a = std::sqrt(std::max(0.0, 1.0 - b * b - c * c - d * d));
    const double handed = header.pixdim(0) < 0 ? -1.0 : 1.0;
    Mat3 r(a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c),  //
           2 * (b * c - a * d), a * a + c * c - b * b - d * d, 2 * (c * d + a * b),  //
           2 * (b * d + a * c), 2 * (c * d - a * b), a * a + d * d - c * c - b * b);
    r[0] *= std::abs(header.pixdim(1));
    r[1] *= std::abs(header.pixdim(2));
    r[2] *= std::abs(header.pixdim(3)) * handed;
    return toPatient(r, {header.quaternion(3), header.quaternion(4), header.quaternion(5)}, unit);
}

// Metres in the file's unit of length.
double unitOf(const std::filesystem::path& file, const NiftiHeader& header)
{
    switch (header.units() & 7) {
        case 1:
            return 1.0;
        case 0:
        case 2:
            return 1e-3;
        case 3:
            return 1e-6;
        default:
            refuse(file, "xyzt_units = {}: the unit of length is unknown, save it again", header.units());
    }
}

// How far two placements of the same voxels are apart at most, in voxels of `a`.
double disagreement(const Affine& a, const Affine& b, Index3 size)
{
    double most = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3 index = Vec3(size - 1) * Vec3(corner & 1, (corner >> 1) & 1, (corner >> 2) & 1);
        const Vec3 apart = glm::abs(a.toIndex(b.toPatient(index)) - index);
        most = std::max({most, apart.x, apart.y, apart.z});
    }
    return most;
}

// Spacings alone: the header does not say where the axes run.
void placePlain(const NiftiHeader& header, Source& source)
{
    const double unit = header.analyze() ? 1e-3 : unitOf(source.header, header);
    source.oriented = false;
    source.affine = Affine{
        unit * Mat3(std::abs(header.pixdim(1)), 0, 0, 0, std::abs(header.pixdim(2)), 0, 0, 0, std::abs(header.pixdim(3))),
        Vec3(0.0)};
}

}  // namespace

void placeNifti(const NiftiHeader& header, Source& source)
{
    if (header.analyze()) {
        placePlain(header, source);
        return;
    }
    const double unit = unitOf(source.header, header);
    const bool hasQ = header.qformCode() > 0;
    const Affine q = qform(header, unit);
    const Affine s = sform(header, unit);
    bool hasS = header.sformCode() > 0;
    // A writer that sets the code and forgets the matrix.
    const bool empty = s.linear == Mat3(0.0);
    if (hasS && empty && hasQ && q.voxelVolume() > 0) {
        hasS = false;
        source.warnings.emplace_back("its sform is all zero, though it has a code: the qform is used");
    }
    if (hasS) {
        source.affine = s;
        const double apart = s.voxelVolume() > 0 && hasQ ? disagreement(s, q, source.size) : 0.0;
        if (!(apart <= 0.1)) {
            source.warnings.push_back(
                fmt::format("its qform and sform disagree by up to {:.1f} voxels: the sform is used", apart));
        }
        return;
    }
    if (hasQ) {
        // The format allows no negative edge, and readers differ in what they make of one: a mirrored axis, or none.
        for (const std::size_t k : {1, 2, 3}) {
            if (header.pixdim(k) < 0) {
                refuse(source.header, "pixdim[{}] = {:g}: it is not known which way this axis runs, save it again", k,
                       header.pixdim(k));
            }
        }
        source.affine = q;
        return;
    }
    placePlain(header, source);
}

}  // namespace palpate::volume
