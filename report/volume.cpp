#include <report/volume.h>

#include <base/vec_json.h>
#include <volume/provenance.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <string>

namespace palpate::report {

namespace {

constexpr double bytesPerMb = 1e6;

double megabytes(std::uint64_t bytes)
{
    return static_cast<double>(bytes) / bytesPerMb;
}

// Unit vector along voxel axis `axis`; without the "-0" that a flipped axis leaves.
Vec3 direction(const volume::Affine& affine, int axis)
{
    return affine.linear[axis] / affine.spacing()[axis] + 0.0;
}

// "left", "posterior", ... for the patient axis nearest to a voxel axis.
std::string towards(Vec3 d)
{
    static constexpr const char* names[3][2] = {{"right", "left"}, {"front", "back"}, {"feet", "head"}};
    const int axis = volume::longestAxis(d);
    const bool oblique = std::abs(d[axis]) < 0.9999;
    return fmt::format("{}{}", names[axis][d[axis] > 0 ? 1 : 0], oblique ? " (oblique)" : "");
}

void printGeometry(const volume::Tissue& tissue)
{
    const Index3 size = tissue.size();
    const volume::Affine& affine = tissue.affine();
    const Vec3 spacing = 1e3 * affine.spacing();
    const Vec3 origin = 1e3 * affine.origin;
    fmt::print("size         {} x {} x {} voxels\n", size.x, size.y, size.z);
    fmt::print("spacing      {:.6g} x {:.6g} x {:.6g} mm\n", spacing.x, spacing.y, spacing.z);
    fmt::print("extent       {:.1f} x {:.1f} x {:.1f} mm\n", size.x * spacing.x, size.y * spacing.y, size.z * spacing.z);
    fmt::print("origin       {:.4f} {:.4f} {:.4f} mm, LPS\n", origin.x, origin.y, origin.z);
    for (int axis = 0; axis < 3; ++axis) {
        const Vec3 d = direction(affine, axis);
        fmt::print("axis {}       {:8.5f} {:8.5f} {:8.5f}  to the {}\n", "ijk"[axis], d.x, d.y, d.z, towards(d));
    }
}

nlohmann::json supportFigures(const volume::Tissue& tissue)
{
    if (!tissue.support()) {
        return nullptr;
    }
    return {{"point_mm", 1e3 * tissue.support()->point}, {"normal", tissue.support()->normal}};
}

void printStructures(const volume::Tissue& tissue)
{
    std::size_t name = 9;
    std::size_t kind = 6;
    for (const volume::Structure& s : tissue.structures()) {
        name = std::max(name, s.name.size());
        kind = std::max(kind, tissue.table().rows[s.tissue].name.size());
    }
    fmt::print("\nlabel  {:<{}}  {:<{}}  role    E [kPa]      voxels   volume [ml]\n", "structure", name, "tissue", kind);
    for (const volume::Structure& s : tissue.structures()) {
        const volume::TissueRow& row = tissue.table().rows[s.tissue];
        fmt::print("{:>5}  {:<{}}  {:<{}}  {:<6} {:>8.5g}  {:>10}  {:>12.3f}\n", s.value, s.name, name, row.name, kind,
                   volume::name(row.role), 1e-3 * row.youngsModulus, s.voxels, 1e6 * s.volume);
    }
}

std::string imageText(const volume::Tissue& tissue)
{
    const std::string unit = tissue.imageUnit().empty() ? "no known unit" : tissue.imageUnit();
    std::string text = fmt::format("on the voxels of the tissue, in {}", unit);
    if (const auto& points = tissue.stiffnessMap().points; !points.empty()) {
        text += fmt::format("; scales the stiffness by {:g} at {:g} to {:g} at {:g}", points.front().second,
                            points.front().first, points.back().second, points.back().first);
    }
    return text;
}

}  // namespace

nlohmann::json volumeFigures(const volume::Tissue& tissue)
{
    const Index3 size = tissue.size();
    const volume::Affine& affine = tissue.affine();
    const Vec3 spacing = 1e3 * affine.spacing();
    const Vec3 origin = 1e3 * affine.origin;
    nlohmann::json labels = nlohmann::json::array();
    for (const volume::Structure& s : tissue.structures()) {
        const volume::TissueRow& row = tissue.table().rows[s.tissue];
        labels.push_back({{"value", s.value},
                          {"name", s.name},
                          {"tissue", row.name},
                          {"role", std::string(volume::name(row.role))},
                          {"youngs_kpa", 1e-3 * row.youngsModulus},
                          {"voxels", s.voxels},
                          {"volume_ml", 1e6 * s.volume}});
    }
    // Row by row, so that column k is the direction of voxel axis k, as ITK has it.
    nlohmann::json directions = nlohmann::json::array();
    for (int row = 0; row < 3; ++row) {
        for (int axis = 0; axis < 3; ++axis) {
            directions.push_back(direction(affine, axis)[row]);
        }
    }
    nlohmann::json provenance = nlohmann::json::object();
    nlohmann::json warnings = nlohmann::json::array(), done = nlohmann::json::array();
    for (const auto& [key, value] : tissue.provenance()) {
        if (key == volume::warningKey) {
            warnings.push_back(value);
        } else if (key == volume::stepKey) {
            done.push_back(value);
        } else {
            provenance[key] = value;
        }
    }
    const volume::MemoryUse use = tissue.memory();
    return {{"size", size},
            {"spacing_mm", spacing},
            {"direction", directions},
            {"origin_mm", origin},
            {"labels", labels},
            {"memory_mb", megabytes(use.label + use.stiffness + use.occupancy + use.image)},
            {"grids_mb",
             {{"label", megabytes(use.label)},
              {"stiffness", megabytes(use.stiffness)},
              {"occupancy", megabytes(use.occupancy)},
              {"image", megabytes(use.image)}}},
            {"support", supportFigures(tissue)},
            {"image", tissue.hasImage() ? nlohmann::json(imageText(tissue)) : nlohmann::json(nullptr)},
            {"done", done},
            {"tissue_table", tissue.table().name},
            {"provenance", provenance},
            {"warnings", warnings}};
}

void printVolume(const volume::Tissue& tissue)
{
    printGeometry(tissue);
    printStructures(tissue);
    const volume::MemoryUse use = tissue.memory();
    fmt::print("\nmemory       {:.1f} MB: label {:.1f}, stiffness {:.1f}, occupancy {:.1f}{}\n",
               megabytes(use.label + use.stiffness + use.occupancy + use.image), megabytes(use.label),
               megabytes(use.stiffness), megabytes(use.occupancy),
               tissue.hasImage() ? fmt::format(", image {:.1f}", megabytes(use.image)) : "");
    if (tissue.hasImage()) {
        fmt::print("image        {}\n", imageText(tissue));
    }
    if (tissue.support()) {
        const Vec3 p = 1e3 * tissue.support()->point, n = Vec3(0.0) - tissue.support()->normal;
        fmt::print(
            "held         nothing in it is fixed: it lies on its back, held behind {:.1f} {:.1f} {:.1f} mm towards {:.2f} "
            "{:.2f} {:.2f}; import --set NAME=chest_wall holds a structure\n",
            p.x, p.y, p.z, n.x, n.y, n.z);
    }
    fmt::print("tissues      {}\n", tissue.table().name);
    for (const auto& [key, value] : tissue.provenance()) {
        fmt::print("{:<12} {}\n", key, value);
    }
}

}  // namespace palpate::report
