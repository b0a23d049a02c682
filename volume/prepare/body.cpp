#include <volume/prepare/body.h>

#include <base/error.h>
#include <volume/clean.h>
#include <volume/import.h>
#include <volume/prepare/bone.h>
#include <volume/prepare/masks.h>

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace palpate::prepare {

namespace {

using volume::LabelImage;
using volume::LabelName;
using volume::Role;
using volume::VoxelGrid;

constexpr const char* imageOption = "--body-from-image";

// CT numbers [HU]; their sources are in docs/researcher.md, "A body around the organs".
constexpr float airBelow = -500;       // outside the body; inside it lung or gas
constexpr float gasBelow = -930;       // gas, where half of a region is so; else lung
constexpr float fatTo = -30;           // and above it muscle and other soft tissue
constexpr float muscleTo = 85;         // smoothed; what is brighter is cartilage, or an organ with contrast medium
constexpr double vesselTo = 500;       // no blood is brighter
constexpr double evenness = 0.15;      // standard deviation inside a vessel, fraction of its mean
constexpr double shellBrighter = 0.3;  // than the inside, as a fraction of it: a bone's shell

// Lengths [m], areas [m^2] and volumes [m^3].
constexpr double smoothing = 3e-3;
constexpr double tableSheet = 4e-3;  // half the thickness of what is taken for table, clothes and cables
constexpr double keptPiece = 1e-6;   // a loose piece of body with so much of a label is kept
constexpr double minLung = 20e-6;
constexpr double lungVessels = 4e-3;  // radius of vessels that count as lung
constexpr double vesselRim = 2e-3;    // of what is not taken for a vessel's inside
constexpr double minVessel = 1e-6;
constexpr double rimDepth = 10e-3;   // fat so near to the surface is fat under the skin
constexpr double fatBridge = 6e-3;   // half the thickness of what connects it with further fat under the skin
constexpr double wallDepth = 12e-3;  // of the muscles under that fat
constexpr double boneReach = 20e-3;  // of the muscles around a bone
constexpr double thinnestMuscle = 2e-3;
constexpr double disc = 7e-3;                               // half the gap between vertebrae
constexpr double skinThickness = 2e-3, skinDeepest = 6e-3;  // of what is skin in any case; of what is, where it is no fat

enum Found : std::uint8_t { none, outside, gas, lung, fat, muscle, soft, bone, vessel, skin, foundCount };

struct FoundTissue {
    const char* name;
    const char* tissue;
};
constexpr std::array<FoundTissue, foundCount> tissueOf{{{"", ""},
                                                        {"", ""},
                                                        {"body_gas", "bowel"},
                                                        {"body_lung", "lung"},
                                                        {"body_fat", "fat"},
                                                        {"body_muscle", "muscle"},
                                                        {"body_soft_tissue", "soft_tissue"},
                                                        {"body_bone", "bone"},
                                                        {"body_vessel", "artery"},
                                                        {"body_skin", "skin"}}};

// Puts what was found into the label map, and rows into its names.
class Labeller {
public:
    Labeller(LabelImage& image, std::vector<LabelName>& names, const volume::TissueTable& table)
        : image_(image),
          names_(names),
          table_(table),
          used_(65536, false),
          roles_(65536, Role::plain),
          muscle_(65536, false)
    {
        for (const std::uint16_t v : image.values) {
            used_[v] = true;
        }
        roles_[0] = Role::air;
        for (const LabelName& n : names) {
            used_[n.value] = true;
            const auto row = table.find(n.tissue);
            muscle_[n.value] = n.tissue == "muscle";
            roles_[n.value] = row ? table.rows[*row].role : Role::plain;
        }
    }

    /// A label of tissue: what nothing may overwrite.
    bool labelled(std::size_t voxel) const { return role(voxel) != Role::air; }

    Role role(std::size_t voxel) const { return roles_[image_.values[voxel]]; }

    bool isMuscle(std::size_t voxel) const { return muscle_[image_.values[voxel]]; }

    std::uint16_t add(const std::string& name, const std::string& tissue)
    {
        base::failIf(!table_.find(tissue), "the tissue table '{}' has no '{}', which {} is to be: add one to it",
                     table_.name, tissue, name);
        const auto at = std::find(used_.begin() + 1, used_.end(), false);
        base::failIf(at == used_.end(), "every label value from 1 to 65535 is in use: save the labels with fewer");
        *at = true;
        const auto value = static_cast<std::uint16_t>(at - used_.begin());
        names_.push_back({value, name, tissue});
        return value;
    }

private:
    LabelImage& image_;
    std::vector<LabelName>& names_;
    const volume::TissueTable& table_;
    std::vector<bool> used_;
    std::vector<Role> roles_;  // by label value
    std::vector<bool> muscle_;
};

void checkAxes(const LabelImage& image, const char* option)
{
    constexpr double most = 0.002;  // as formats.md has it [rad]
    base::failIf(volume::shearOf(image.affine) > most,
                 "{}: the voxels' axes are not at right angles: resample the labels first "
                 "(import them with --voxel, export them, and import that)",
                 option);
}

/// What is where in the CT. One step after the other, each on voxels that none before it has taken.
class Finder {
public:
    Finder(const LabelImage& image, const Labeller& labels, std::vector<float> hu)
        : grid_{image.size, image.affine},
          labels_(labels),
          hu_(std::move(hu)),
          found_(hu_.size(), none),
          boneFrom_(boneThreshold(grid_))
    {
        for (float& v : hu_) {
            v = std::isnan(v) ? -1000.0F : v;
        }
    }

    const std::vector<Found>& run(const std::function<void(const std::string&)>& tell)
    {
        tell("looking for the body");
        findBody();
        tell("looking for lungs and gas");
        findLung();
        tell("looking for bone and vessels");
        findVessels();
        findBones();
        tell("looking for fat and muscle");
        findSoft();
        findSkin();
        findMuscle();
        return found_;
    }

    /// Dense pieces that are no body [m^3].
    double leftOut() const { return leftOut_; }

private:
    template <typename Wanted>
    Mask where(const Wanted& wanted) const
    {
        Mask out(hu_.size());
        for (std::size_t i = 0; i < out.size(); ++i) {
            out[i] = wanted(i) ? 1 : 0;
        }
        return out;
    }

    bool isFree(std::size_t i) const { return found_[i] == none && !labels_.labelled(i); }

    // Dense voxels without thin sheets, the largest piece and those with labels; what that encloses in an axial slice.
    void findBody()
    {
        const Mask dense = where([&](std::size_t i) { return hu_[i] > airBelow || labels_.labelled(i); });
        Mask core = eroded(grid_, dense, tableSheet);
        const MaskPieces pieces = piecesOf(grid_, core, {});
        base::failIf(pieces.pieces.empty(),
                     "--body-from-image: nothing in the image is as dense as a body: is it a CT in Hounsfield units?");
        std::vector<std::uint64_t> labelled(pieces.pieces.size(), 0);
        std::size_t largest = 0;
        for (std::size_t p = 0; p < pieces.pieces.size(); ++p) {
            largest = pieces.pieces[p].voxels > pieces.pieces[largest].voxels ? p : largest;
        }
        for (std::size_t i = 0; i < core.size(); ++i) {
            labelled[core[i] != 0 ? pieces.of[i] - 1 : 0] += core[i] != 0 && labels_.labelled(i) ? 1 : 0;
        }
        const double voxel = grid_.affine.voxelVolume();
        for (std::size_t i = 0; i < core.size(); ++i) {
            const std::size_t p = core[i] != 0 ? pieces.of[i] - 1 : 0;
            core[i] = core[i] != 0 && (p == largest || static_cast<double>(labelled[p]) * voxel >= keptPiece) ? 1 : 0;
        }
        const Vec3 spacing = grid_.affine.spacing();
        Mask body = dilated(grid_, core, tableSheet + std::min({spacing.x, spacing.y, spacing.z}));
        for (std::size_t i = 0; i < body.size(); ++i) {
            body[i] = (body[i] != 0 && dense[i] != 0) || labels_.labelled(i) ? 1 : 0;
        }
        for (std::size_t i = 0; i < body.size(); ++i) {
            leftOut_ += pieces.of[i] != 0 && core[i] == 0 && body[i] == 0 ? voxel : 0.0;
        }
        const Mask beyond = outsideBySlices(grid_, body, hu_, gasBelow);
        for (std::size_t i = 0; i < beyond.size(); ++i) {
            found_[i] = beyond[i] != 0 ? outside : none;
        }
    }

    void findLung()
    {
        const Mask thin = where([&](std::size_t i) { return isFree(i) && hu_[i] < airBelow; });
        const MaskPieces pieces = piecesOf(grid_, thin, hu_, gasBelow);
        const double voxel = grid_.affine.voxelVolume();
        Mask lungs(thin.size(), 0);
        for (std::size_t i = 0; i < thin.size(); ++i) {
            if (thin[i] == 0) {
                continue;
            }
            const MaskPiece& piece = pieces.pieces[pieces.of[i] - 1];
            const bool isLung = static_cast<double>(piece.voxels) * voxel >= minLung && piece.low < 0.5;
            lungs[i] = isLung ? 1 : 0;
            found_[i] = isLung ? lung : gas;
        }
        const Mask whole = closed(grid_, lungs, lungVessels);
        for (std::size_t i = 0; i < whole.size(); ++i) {
            found_[i] = whole[i] != 0 && isFree(i) && hu_[i] < boneFrom_ ? lung : found_[i];
        }
    }

    // Blood with contrast medium is as dense as bone, but even: no shell brighter than its inside, no marrow darker. Only
    // what is thick enough to have an inside is judged; what hangs together with a bone's inside is bone.
    void findVessels()
    {
        struct Judged {
            double square = 0, inside = 0, bright = 0, all = 0;
        };
        const Vec3 spacing = grid_.affine.spacing();
        const double rim = std::max(vesselRim, std::min({spacing.x, spacing.y, spacing.z}));
        const Mask dense = where([&](std::size_t i) { return isFree(i) && hu_[i] >= boneFrom_; });
        const MaskPieces cores = piecesOf(grid_, eroded(grid_, dense, rim), hu_);
        const std::vector<std::uint32_t> nearest = spread(cores.of, dense, rim);
        std::vector<Judged> judged(cores.pieces.size());
        for (std::size_t i = 0; i < nearest.size(); ++i) {
            if (nearest[i] != 0) {
                const double mean = cores.pieces[nearest[i] - 1].mean, off = static_cast<double>(hu_[i]) - mean;
                Judged& j = judged[nearest[i] - 1];
                j.square += cores.of[i] != 0 ? off * off : 0.0;
                j.inside += cores.of[i] != 0 ? 1 : 0;
                j.bright += off > shellBrighter * mean ? 1 : 0;
                j.all += 1;
            }
        }
        std::vector<std::uint8_t> isVessel(cores.pieces.size() + 1, 0);
        for (std::size_t p = 0; p < judged.size(); ++p) {
            const Judged& j = judged[p];
            const double mean = cores.pieces[p].mean;
            const bool even = std::sqrt(j.square / j.inside) < evenness * mean && j.bright < 0.05 * j.all;
            isVessel[p + 1] = even && mean < vesselTo && j.all * grid_.affine.voxelVolume() >= minVessel ? 1 : 0;
        }
        for (std::size_t i = 0; i < nearest.size(); ++i) {
            found_[i] = isVessel[nearest[i]] != 0 ? vessel : found_[i];
        }
    }

    // Numbers of pieces for the voxels of `within` that lie no further from a piece than `reach` [m].
    std::vector<std::uint32_t> spread(const std::vector<std::uint32_t>& piece, const Mask& within, double reach) const
    {
        const Vec3 spacing = grid_.affine.spacing();
        const Index3 around(glm::ceil(reach / spacing - 1e-6));
        const LabelImage places{grid_.size, grid_.affine, {}};
        std::vector<std::uint32_t> out = piece;
        const auto nearestPiece = [&](Index3 n) {
            std::uint32_t found = 0;
            double least = std::numeric_limits<double>::infinity();
            volume::forEachIndex(glm::max(n - around, Index3(0)), glm::min(n + around, grid_.size - 1), [&](Index3 m) {
                const double away = glm::length(spacing * Vec3(m - n));
                if (piece[places.offset(m)] != 0 && away < least) {
                    least = away;
                    found = piece[places.offset(m)];
                }
            });
            return found;
        };
        tbb::parallel_for(0, grid_.size.z, [&](int z) {
            volume::forEachIndex(Index3(0, 0, z), Index3(grid_.size.x - 1, grid_.size.y - 1, z), [&](Index3 n) {
                const std::size_t at = places.offset(n);
                out[at] = within[at] != 0 && piece[at] == 0 ? nearestPiece(n) : piece[at];
            });
        });
        return out;
    }

    // What else attenuates more than soft tissue, and the marrow in it.
    void findBones()
    {
        const Mask may = where([&](std::size_t i) { return isFree(i); });
        const Mask known = where([&](std::size_t i) { return labels_.role(i) == Role::bone; });
        const Mask bones = findBone(grid_, hu_, may, known);
        for (std::size_t i = 0; i < bones.size(); ++i) {
            found_[i] = bones[i] != 0 ? bone : found_[i];
        }
    }

    void findSoft()
    {
        for (std::size_t i = 0; i < found_.size(); ++i) {
            if (isFree(i)) {
                found_[i] = hu_[i] < fatTo ? fat : soft;
            }
        }
    }

    // Muscle is soft tissue of the body's wall: near the fat under the skin, or near bone. What is brighter is cartilage,
    // what lies between vertebrae are discs, and the rest are viscera.
    void findMuscle()
    {
        const Mask beyond = where([&](std::size_t i) { return found_[i] == outside; });
        const Mask rim = dilated(grid_, beyond, rimDepth);
        Mask fats = where([&](std::size_t i) { return found_[i] == fat || found_[i] == skin; });
        const Mask thick = eroded(grid_, fats, fatBridge);
        const MaskPieces pieces = piecesOf(grid_, thick, {});
        std::vector<std::uint8_t> outer(pieces.pieces.size() + 1, 0);
        for (std::size_t i = 0; i < thick.size(); ++i) {
            outer[pieces.of[i]] |= rim[i];
        }
        outer[0] = 0;
        Mask under = where([&](std::size_t i) { return outer[pieces.of[i]] != 0; });
        under = dilated(grid_, under, fatBridge);
        for (std::size_t i = 0; i < under.size(); ++i) {
            under[i] = rim[i] != 0 || (under[i] != 0 && fats[i] != 0) ? 1 : 0;
        }
        under = dilated(grid_, under, wallDepth);
        const Mask bones = where([&](std::size_t i) { return found_[i] == bone || labels_.role(i) == Role::bone; });
        const std::vector<float> smooth = boxMeans(grid_, hu_, smoothing);
        const Mask nearBone = dilated(grid_, bones, boneReach), between = closed(grid_, bones, disc);
        const auto isWall = [&](std::size_t i) {
            return found_[i] == soft && (under[i] != 0 || nearBone[i] != 0) && between[i] == 0 && smooth[i] < muscleTo;
        };
        const Mask thickWall =
            where([&](std::size_t i) { return isWall(i) || bones[i] != 0 || found_[i] == skin || labels_.isMuscle(i); });
        const Mask wall = dilated(grid_, eroded(grid_, thickWall, thinnestMuscle), thinnestMuscle);
        for (std::size_t i = 0; i < found_.size(); ++i) {
            found_[i] = isWall(i) && wall[i] != 0 ? muscle : found_[i];
        }
    }

    // The outermost layer of fat, muscle and soft tissue, a voxel at least, and dermis below it: no fat, close to it.
    void findSkin()
    {
        const Vec3 spacing = grid_.affine.spacing();
        const double thickness = std::max(skinThickness, std::min({spacing.x, spacing.y, spacing.z}));
        const Mask beyond = where([&](std::size_t i) { return found_[i] == outside; });
        const Mask layer = dilated(grid_, beyond, thickness), faces = touching(grid_, beyond);
        const Mask deep = dilated(grid_, beyond, skinDeepest);
        for (std::size_t i = 0; i < layer.size(); ++i) {
            const bool may = found_[i] == fat || found_[i] == soft;
            const bool outermost = layer[i] != 0 || faces[i] != 0 || (deep[i] != 0 && found_[i] == soft);
            found_[i] = may && outermost ? skin : found_[i];
        }
    }

    VoxelGrid grid_;
    const Labeller& labels_;
    std::vector<float> hu_;
    std::vector<Found> found_;
    float boneFrom_;  // bone, or blood with contrast medium [HU]
    double leftOut_ = 0;
};

// Gives the voxels without a label what was found there.
std::vector<PreparationStep> fill(LabelImage& image, Labeller& labels, const std::vector<Found>& found,
                                  const std::array<FoundTissue, foundCount>& what, const char* step, const char* source)
{
    std::array<std::uint64_t, foundCount> voxels{};
    for (std::size_t i = 0; i < found.size(); ++i) {
        voxels[found[i]] += labels.labelled(i) ? 0 : 1;
    }
    std::array<std::uint16_t, foundCount> value{};
    std::vector<PreparationStep> steps;
    for (std::size_t f = gas; f < foundCount; ++f) {
        if (voxels[f] > 0) {
            value[f] = labels.add(what[f].name, what[f].tissue);
            const double volume = static_cast<double>(voxels[f]) * image.affine.voxelVolume();
            steps.push_back({step, what[f].name,
                             fmt::format("{}: {} voxels ({:.3g} ml) {}", what[f].name, voxels[f], 1e6 * volume, source),
                             voxels[f], volume, 0, ""});
        }
    }
    for (std::size_t i = 0; i < found.size(); ++i) {
        if (!labels.labelled(i)) {
            image.values[i] = value[found[i]];
        }
    }
    return steps;
}

// The labels on a grid that goes on by `before` and `after` voxels along each axis.
LabelImage extended(const LabelImage& image, Index3 before, Index3 after, const char* option)
{
    constexpr double maxVoxels = 4e9;
    const Vec3 size = Vec3(image.size + before + after);
    base::failIf(!(size.x * size.y * size.z < maxVoxels),
                 "{}: makes over 4 thousand million voxels: resample the labels to larger "
                 "ones first, or crop the image",
                 option);
    const LabelImage more = volume::padded(image, glm::max(before, after));
    const Index3 low = glm::max(before, after) - before;
    return volume::cropped(more, low, low + image.size + before + after - 1);
}

}  // namespace

void extendToImage(LabelImage& labels, const VoxelGrid& ct)
{
    Vec3 low(0.0), high(labels.size - 1);
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3 n = Vec3(ct.size - 1) * Vec3(corner & 1, (corner >> 1) & 1, (corner >> 2) & 1);
        const Vec3 at = labels.affine.toIndex(ct.affine.toPatient(n));
        low = glm::min(low, at);
        high = glm::max(high, at);
    }
    constexpr double rounding = 0.01;
    const Index3 before(glm::max(glm::floor(rounding - low), Vec3(0.0)));
    const Index3 after(glm::max(glm::floor(high - Vec3(labels.size - 1) + rounding), Vec3(0.0)));
    if (before != Index3(0) || after != Index3(0)) {
        labels = extended(labels, before, after, imageOption);
    }
}

std::vector<PreparationStep> bodyFromImage(LabelImage& image, std::vector<LabelName>& names, std::vector<float> hu,
                                           const volume::TissueTable& table,
                                           const std::function<void(const std::string&)>& tell)
{
    checkAxes(image, imageOption);
    Labeller labels(image, names, table);
    Finder finder(image, labels, std::move(hu));
    const std::vector<Found>& found = finder.run(tell);
    auto steps = fill(image, labels, found, tissueOf, "body-from-image", "found in the image");
    if (finder.leftOut() > 0) {
        steps.push_back({"body-from-image", "",
                         fmt::format("{:.3g} ml beside the body left out: table, clothes, or parts that hang together "
                                     "with it nowhere in the image",
                                     1e6 * finder.leftOut()),
                         0, finder.leftOut(), 0, ""});
    }
    return steps;
}

std::vector<PreparationStep> bodyFromHull(LabelImage& image, std::vector<LabelName>& names, double thickness,
                                          const volume::TissueTable& table,
                                          const std::function<void(const std::string&)>& tell)
{
    constexpr const char* option = "--body-from-hull";
    checkAxes(image, option);
    tell("inventing a body");
    const Index3 around = Index3(glm::ceil(thickness / image.affine.spacing())) + 2;
    image = extended(image, around, around, option);
    Labeller labels(image, names, table);
    const VoxelGrid grid{image.size, image.affine};
    Mask organs(image.values.size());
    for (std::size_t i = 0; i < organs.size(); ++i) {
        organs[i] = labels.labelled(i) ? 1 : 0;
    }
    base::failIf(std::find(organs.begin(), organs.end(), 1) == organs.end(), "{}: no voxel has a label of tissue", option);
    Mask hull = dilated(grid, organs, thickness);
    fillHolesBySlices(grid, hull);
    const Vec3 spacing = image.affine.spacing();
    const double depth = std::max({skinThickness, spacing.x, spacing.y, spacing.z});
    const Mask inner = eroded(grid, hull, depth);
    std::vector<Found> found(hull.size(), outside);
    for (std::size_t i = 0; i < found.size(); ++i) {
        found[i] = inner[i] != 0 ? soft : hull[i] != 0 ? skin : outside;
    }
    auto what = tissueOf;
    what[soft].name = "invented_soft_tissue";
    what[skin].name = "invented_skin";
    return fill(image, labels, found, what, "body-from-hull", "invented around the labels: no image was asked");
}

}  // namespace palpate::prepare
