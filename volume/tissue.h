#pragma once

#include <volume/geometry.h>
#include <volume/label_image.h>
#include <volume/scalar_field.h>
#include <volume/tissue_table.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace palpate::volume {

/// One structure of a volume: a label value with its name, tissue and size.
struct Structure {
    std::uint16_t value = 0;                                           // that its voxels have
    std::string name;                                                  // "tumour", "left lung"
    std::uint8_t tissue = 0;                                           // row of the tissue table
    std::uint64_t voxels = 0;                                          // how many
    double volume = 0;                                                 // [m^3]
    std::optional<std::array<std::uint8_t, 3>> colour = std::nullopt;  // as in LabelName
    std::string terminology = {};                                      // as in LabelName
};

/// Where a volume comes from, kept in the file.
using Provenance = std::vector<std::pair<std::string, std::string>>;  // key, value

/// Bytes held by each grid.
struct MemoryUse {
    std::uint64_t label = 0;      // grid of label values
    std::uint64_t stiffness = 0;  // of Young's modulus
    std::uint64_t occupancy = 0;  // of where there is tissue
    std::uint64_t image = 0;      // of the image; 0: none
};

/// How an image scales Young's modulus: a factor, piecewise linear in the image's value and constant beyond the points.
struct StiffnessMap {
    std::vector<std::pair<double, double>> points;  // value, factor; by value. None: the image changes nothing
    std::vector<std::string> tissues;               // of the table, that it applies to; none: all of them
    std::vector<std::uint16_t> notOf;               // labels that it leaves as the table has them

    double factor(double value) const noexcept;  // of the modulus, at a value of the image
};

/// An intensity image on the voxels of a label map.
struct CompanionImage {
    std::vector<float> values;  // one per voxel, x fastest
    std::string unit;           // "HU", or empty
    StiffnessMap stiffness;     // what it does to Young's modulus
};

/// Where in a cell tissue lies that is held in space, of cells with such tissue.
struct HeldParts {
    static constexpr int edgeCount = 12;  ///< of a cell
    /// Which eighths of each edge it lies on, a bit for each from the edge's lower end on. Edge `e` runs along axis e / 4.
    std::array<std::uint8_t, edgeCount> edges{};
    Vec3f middle{0.0F};  // of it, -1 to 1 along each edge of the cell

    /// Lower end of an edge in its cell, 0 or 1 along each axis.
    static Index3 startOf(int edge) noexcept
    {
        Index3 start(0);
        start[(edge / 4 + 1) % 3] = edge & 1;
        start[(edge / 4 + 2) % 3] = edge >> 1 & 1;
        return start;
    }
};

/// The tissue in a cell as one elastic material.
struct CellMaterial {
    /// Root of arithmetic times harmonic mean, times the fraction of the cell that is tissue; where some of it is held in
    /// space, that of the rest, stiffer by as much as it is thinner [Pa].
    float youngsModulus = 0;
    float poissonRatio = 0;                         // mean over the tissue [-]
    float fraction = 1;                             // of the cell that is tissue [-]
    float fixed = 0;                                // fraction of the tissue that is held in space [-]
    float stiffening = 0;                           // mean over the tissue [-]
    std::array<float, relaxationTerms> relaxing{};  // weights of Relaxation, mean over what is not held [-]
    float along = 1;  // of layers along their plane: youngsModulus with the arithmetic mean, over what it is [-]
    /// Where the stiffer part of it lies, -1 to 1 along each edge of the cell: middle of what its modulus has over the
    /// softest tissue's.
    Vec3f middle{0.0F};
    float share = 0;  // of what is not held: that part [-]
    /// Across the layers in which its tissues lie, a unit vector of either sign; 0 where they lie in none.
    Vec3f normal{0.0F};
    /// Which of its eighths are mostly tissue, a bit for each, x fastest; none may be where little of it is tissue.
    std::uint8_t octants = 0xFF;
    /// Which of its 64 parts, a quarter of an edge wide, have tissue in their middle, a bit for each, x fastest; all of
    /// them where voxels are longer than three quarters of a cell.
    std::uint64_t quarters = ~std::uint64_t{0};
    HeldParts held{};  ///< what is held in space by its tissue, such as bone, not by a support
};

/// A body as OpenVDB grids: label, stiffness [kPa in the file] and occupancy, with affine, tissue table and provenance.
///
///     label      Int32, background 0   the label value of every voxel
///     stiffness  Float, background 0   Young's modulus [kPa], per voxel
///     occupancy  Bool,  background 0   true where there is tissue
///     image      Float                 an intensity image, outside the labels too; only of volumes that came with one
///
/// Homogeneous regions are stored as tiles. Immutable, so that threads may share it; each thread reads through its own
/// Reader. OpenVDB stays behind this header.
class Tissue {
public:
    /// Builds the grids of `image`, whose values have these `names` with tissues of this `table`; an image beside it (may
    /// be null) is kept and may scale the stiffness. Voxels of role air, and value 0 when it has no name, are outside.
    /// Throws std::runtime_error for a label value without a name or a name without a tissue.
    static Tissue fromLabels(const LabelImage& image, TissueTable table, std::span<const LabelName> names,
                             Provenance provenance, const CompanionImage* companion = nullptr);
    /// Reads a .vdb that save() wrote. Throws std::runtime_error ("FILE: what is wrong and what to do").
    static Tissue load(const std::filesystem::path& file);
    /// Writes beside `file` and renames, so that a full disk leaves what was there.
    void save(const std::filesystem::path& file) const;

    Tissue(Tissue&&) noexcept;             // leaves the other only to be destroyed
    Tissue& operator=(Tissue&&) noexcept;  // as above
    ~Tissue();

    Index3 size() const noexcept;                            // voxels along each axis
    const Affine& affine() const noexcept;                   // of the voxels [m]
    const TissueTable& table() const noexcept;               // kept in the file too
    std::span<const Structure> structures() const noexcept;  // every label value in the volume, 0 included, by value
    const Provenance& provenance() const noexcept;           // where it comes from
    MemoryUse memory() const;                                // of the grids [bytes]
    /// The label map that it was made from.
    LabelImage labels() const;
    /// The image that it came with; where it had none, the value of air (-1000 HU, else 0).
    std::optional<CompanionImage> companion() const;
    bool hasImage() const noexcept;  // came with a CT or MR
    /// Of the image: its unit and what it does to the stiffness.
    const std::string& imageUnit() const noexcept;
    const StiffnessMap& stiffnessMap() const noexcept;  // none: changes nothing
    /// Box of the voxels that hold tissue [m].
    Box box() const noexcept;
    /// A body in which no tissue is fixed lies on its back: its rear 5 % are held, in whole layers of voxels along the axis
    /// nearest to y (LPS: to the back), at least one. Nothing where tissue is fixed, or there is none.
    const std::optional<Support>& support() const noexcept;
    /// The structure called `name`, else those whose tissue is called so. Empty when there is none.
    std::vector<std::uint16_t> labelsNamed(std::string_view name) const;

    /// Reads voxels at 1 kHz: allocates nothing, locks nothing. One per thread; the Tissue must outlive it.
    class Reader {
    public:
        explicit Reader(const Tissue& tissue);  // allocates
        Reader(Reader&&) noexcept;              // leaves the other only to be destroyed
        ~Reader();
        /// Label value of the voxel around `p` [m]; 0 outside.
        std::uint16_t label(Vec3 p) const noexcept;
        /// Row of the tissue table around `p`; 0 (air) outside.
        std::uint8_t tissue(Vec3 p) const noexcept;
        /// Young's modulus around `p` [Pa]; 0 outside.
        double youngsModulus(Vec3 p) const noexcept;

    private:
        struct Impl;
        std::unique_ptr<Impl> impl_;
    };

    /// Signed distance to the surface of all voxels whose label is in `labels`, sampled on `grid` [m], sub-voxel smooth;
    /// the enclosed volume is kept also where the structure is thinner than the spacing. Throws when no voxel has these
    /// labels.
    DistanceField distanceTo(std::span<const std::uint16_t> labels, const NodeGrid& grid) const;
    /// Signed distance to the surface of the whole body. Parts that are a voxel thick are as thick as their voxels, where
    /// these are no thinner than `grid` is wide.
    DistanceField distanceToBody(const NodeGrid& grid) const;
    /// Young's modulus [Pa] averaged over each node's cell: the root of arithmetic times harmonic mean over the tissue in
    /// it (air does not count); cells without tissue take the value of the nearest tissue.
    ScalarField youngsModulusOn(const NodeGrid& grid) const;
    /// What fills each node's cell, for elastic models (count x 1).
    std::vector<CellMaterial> materialOn(const NodeGrid& grid) const;
    /// The same where `surface` is the body's, of distanceToBody() on any grid: cells that it cuts are as full as it says,
    /// so that the steps of voxels are not felt in their stiffness. Where it says something quite different from the
    /// voxels, as in structures thinner than its spacing, these decide.
    std::vector<CellMaterial> materialOn(const NodeGrid& grid, const DistanceField& surface) const;
    /// Row of the tissue table that fills most of each node's cell (count x 1); air where under half of it is tissue.
    std::vector<std::uint8_t> tissueOn(const NodeGrid& grid) const;
    /// Mean of the image over the tissue in each node's cell; not a number where there is none, or no image (count x 1).
    std::vector<float> imageOn(const NodeGrid& grid) const;

private:
    struct Impl;
    explicit Tissue(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::volume
