#include <datasets/crossing.h>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <string_view>

namespace palpate::datasets {

namespace {

using volume::Role;
using volume::Tissue;

// Hollow organs and lung: they leak, or collapse, where a needle has been.
// Source: (recall) S. Gupta, D. C. Madoff, "Image-guided percutaneous needle biopsy in cancer diagnosis and staging",
// Techniques in Vascular and Interventional Radiology 10, 2007; A. Veltri et al., "CIRSE guidelines on percutaneous needle
// biopsy", Cardiovascular and Interventional Radiology 40, 2017.
constexpr std::array<std::string_view, 6> notThrough{"lung", "bowel", "stomach", "esophagus", "gallbladder", "bladder"};

// Organs behind the peritoneum, which are reached from the back or the flank. Source: as above.
constexpr std::array<std::string_view, 3> retroperitoneal{"kidney", "adrenal", "pancreas"};
// Organs below the ribs. Source: as above; between the ribs, over the upper edge of the lower one, or under them.
constexpr std::array<std::string_view, 3> underRibs{"liver", "spleen", "lung"};

constexpr double step = 0.5e-3;          // along a way [m]
constexpr double noise = 1e-3;           // less of a structure is no crossing [m]
constexpr float airBelow = -500;         // as the body of an import has it [HU]
constexpr float denseFrom = 150;         // blood with contrast medium, or bone [HU]
constexpr double denseLength = 3e-3;     // of it on the way, at least [m]
constexpr double outsideLength = 0.06;   // of needle that must be outside before it enters [m]
constexpr double tissueOutside = 10e-3;  // so much tissue there is no clothing and no edge [m]
constexpr double lungReach = 0.12;       // to either side, where lungs make a mediastinum [m]
constexpr double lungStep = 3e-3;        // [m]
constexpr double ribReach = 25e-3;       // [m]
constexpr double usualCorridor = 30e-3;  // a way off the usual corridor is taken if it is so much shorter [m]
constexpr double withoutWarning = 0.1;   // a way that the image warns of is taken if it is so much shorter [m]
constexpr double fromTheBack = -0.2;     // least component to the back of the way out

template <typename List>
bool isIn(const List& list, std::string_view name)
{
    return std::find(list.begin(), list.end(), name) != list.end();
}

void addOnce(std::vector<std::string>& list, const std::string& text)
{
    if (std::find(list.begin(), list.end(), text) == list.end()) {
        list.push_back(text);
    }
}

}  // namespace

// What has been met on the way in so far.
struct WayJudge::Walk {
    const Tissue::Reader& reader;
    std::map<std::string, double> dense;       // by structure: length of what the CT shows as blood or bone [m]
    std::vector<std::uint16_t> label;          // of every step
    double outside = 0, outsideButTissue = 0;  // [m]
    bool mediastinum = false;
};

WayJudge::WayJudge(const Scene& scene, const Tissue& tissue)
    : tissue_(tissue), nameOf_(65536), tissueOf_(65536), target_(65536, 0), vital_(65536, 0)
{
    const volume::TissueTable& table = tissue.table();
    for (const volume::Structure& s : tissue.structures()) {
        const volume::TissueRow& row = table.rows[s.tissue];
        nameOf_[s.value] = row.role == Role::air ? "" : s.name;
        tissueOf_[s.value] = row.name;
        hasSkin_ = hasSkin_ || row.role == Role::skin;
        hasLung_ = hasLung_ || row.name == "lung";
        hasBone_ = hasBone_ || row.role == Role::bone;
        vital_[s.value] = row.role == Role::vital ? 1 : 0;
    }
    for (const VitalStructure& v : scene.vital) {
        for (const std::uint16_t label : tissue.labelsNamed(v.name)) {
            vital_[label] = 1;
        }
    }
    for (const std::uint16_t label :
         scene.target.empty() ? std::vector<std::uint16_t>{} : tissue.labelsNamed(scene.target)) {
        target_[label] = 1;
        vital_[label] = 0;
        organ_ = tissueOf_[label];
    }
    if (tissue.hasImage() && tissue.imageUnit() == "HU") {
        hu_ = tissue.companion()->values;
    }
}

// Mean over a voxel and its neighbours: a single voxel of a thin slice is noise.
std::optional<float> WayJudge::image(Vec3 p) const
{
    const Index3 size = tissue_.size(), at(glm::floor(tissue_.affine().toIndex(p) + 0.5));
    for (int axis = 0; axis < 3; ++axis) {
        if (hu_.empty() || at[axis] < 0 || at[axis] >= size[axis]) {
            return std::nullopt;
        }
    }
    float sum = 0, count = 0;
    volume::forEachIndex(glm::max(at - 1, Index3(0)), glm::min(at + 1, size - 1), [&](Index3 n) {
        const auto row = static_cast<std::size_t>(n.z) * static_cast<std::size_t>(size.y) + static_cast<std::size_t>(n.y);
        sum += hu_[row * static_cast<std::size_t>(size.x) + static_cast<std::size_t>(n.x)];
        count += 1;
    });
    return sum / count;
}

bool WayJudge::inMediastinum(const Tissue::Reader& reader, Vec3 p) const
{
    const auto lungTo = [&](double side) {
        for (double t = lungStep; t < lungReach; t += lungStep) {
            if (tissueOf_[reader.label(p + Vec3(side * t, 0, 0))] == "lung") {
                return true;
            }
        }
        return false;
    };
    return lungTo(-1) && lungTo(1);
}

void WayJudge::cross(Walk& walk, Vec3 p, double length, WayVerdict& out) const
{
    const std::uint16_t label = walk.reader.label(p);
    walk.label.push_back(label);
    const std::optional<float> hu = image(p);
    if (nameOf_[label].empty()) {
        walk.outside += length;
        walk.outsideButTissue += hu && *hu > airBelow ? length : 0.0;
        return;
    }
    if (target_[label] != 0) {
        return;
    }
    const Role role = tissue_.table().rows[walk.reader.tissue(p)].role;
    if (hu && *hu >= denseFrom && role != Role::bone && vital_[label] == 0) {
        walk.dense[nameOf_[label]] += length;
    }
    if (out.crossings.empty() || out.crossings.back().structure != nameOf_[label]) {
        out.crossings.push_back({nameOf_[label], tissueOf_[label], 0});
    }
    out.crossings.back().length += length;
    // An organ of the abdomen that is labelled is none of the mediastinum, also where lungs lie beside it, as beside the
    // dome of the liver.
    constexpr std::array<std::string_view, 8> noneOfIt{"lung",     "liver",       "spleen",  "kidney",
                                                       "pancreas", "gallbladder", "stomach", "bowel"};
    const bool soft =
        role != Role::bone && role != Role::skin && std::ranges::find(noneOfIt, tissueOf_[label]) == noneOfIt.end();
    if (hasLung_ && soft && !walk.mediastinum && walk.label.size() % 6 == 0) {
        walk.mediastinum = inMediastinum(walk.reader, p);
    }
}

// The organ that the target lies in is what the way goes through right before the target; it may be crossed there, once.
void WayJudge::judgeCrossings(const Walk& walk, WayVerdict& out) const
{
    const auto& labels = walk.label;
    const auto first = std::find_if(labels.begin(), labels.end(), [&](std::uint16_t l) { return target_[l] != 0; });
    auto own = first;
    const std::string home = first != labels.end() && first != labels.begin() ? tissueOf_[*(first - 1)] : "";
    while (own != labels.begin() && tissueOf_[*(own - 1)] == home) {
        --own;
    }
    std::map<std::string, double> lengths;
    for (auto at = labels.begin(); at != labels.end(); ++at) {
        const bool homeOfTarget = tissueOf_[*at] == home && (at >= own || at >= first);
        const bool mayNot = vital_[*at] != 0 || (isIn(notThrough, tissueOf_[*at]) && !homeOfTarget);
        if (mayNot && target_[*at] == 0) {
            lengths[nameOf_[*at]] += step;
        }
    }
    for (const auto& [name, length] : lengths) {
        if (length >= noise) {
            addOnce(out.refusals, fmt::format("through {}", name));
        }
    }
    for (const auto& [name, length] : walk.dense) {
        if (length >= denseLength) {
            addOnce(out.refusals, "through what the image shows as a vessel or bone");
        }
    }
    if (walk.mediastinum) {
        addOnce(out.refusals, "through the mediastinum, between the lungs");
    }
    std::erase_if(out.crossings, [](const Crossing& c) { return c.length < noise; });
    if (walk.outsideButTissue >= noise) {
        addOnce(out.warnings,
                fmt::format("{:.0f} mm of the way that no label has are tissue by the image: give the volume a "
                            "body (palpate import --body-from-image)",
                            1e3 * walk.outsideButTissue));
    }
}

void WayJudge::lookOutside(Vec3 entry, Vec3 outward, WayVerdict& out) const
{
    double tissue = 0;
    for (double t = step; t < outsideLength; t += step) {
        const std::optional<float> hu = image(entry + t * outward);
        tissue += hu && *hu > airBelow ? step : 0.0;
    }
    if (tissue >= tissueOutside) {
        addOnce(out.warnings, fmt::format("the entry lies inside the patient: by the image there are {:.0f} mm of tissue "
                                          "before it",
                                          1e3 * tissue));
    }
    out.detour += out.warnings.empty() ? 0.0 : withoutWarning;
    if (!hasSkin_) {
        addOnce(out.warnings, "nothing in the volume is skin: the needle enters whatever lies outermost");
    }
}

void WayJudge::nameCorridor(const Tissue::Reader& reader, Vec3 entry, Vec3 aim, WayVerdict& out) const
{
    const Vec3 outward = glm::normalize(entry - aim);
    const auto through = [&](const auto& organs) {
        return isIn(organs, organ_) || std::any_of(out.crossings.begin(), out.crossings.end(),
                                                   [&](const Crossing& c) { return isIn(organs, c.tissue); });
    };
    const std::string home = out.crossings.empty() ? organ_ : out.crossings.back().tissue;
    if (isIn(retroperitoneal, organ_) || isIn(retroperitoneal, home)) {
        const bool back = outward.y >= fromTheBack;
        out.corridor = back ? "from the back or flank" : "from the front";
        out.detour += back ? 0.0 : usualCorridor;
    } else if (through(underRibs) && hasBone_) {
        // Ribs lie head and feet of a way between them.
        bool above = false, below = false;
        for (double t = 0; t < glm::distance(entry, aim); t += lungStep) {
            for (double off = lungStep; off < ribReach; off += lungStep) {
                const auto isBone = [&](double z) {
                    return tissue_.table().rows[reader.tissue(entry - t * outward + Vec3(0, 0, z))].role == Role::bone;
                };
                above = above || isBone(off);
                below = below || isBone(-off);
            }
        }
        out.corridor = above && below ? "between ribs" : above ? "below the ribs" : "";
    }
}

WayVerdict WayJudge::judge(const Tissue::Reader& reader, Vec3 entry, Vec3 aim, Vec3 end) const
{
    WayVerdict out;
    Walk walk{reader, {}, {}};
    const double length = glm::distance(entry, end);
    const Vec3 inward = glm::normalize(aim - entry);
    for (double t = 0.5 * step; t < length; t += step) {
        cross(walk, entry + t * inward, step, out);
    }
    judgeCrossings(walk, out);
    lookOutside(entry, -inward, out);
    nameCorridor(reader, entry, aim, out);
    return out;
}

}  // namespace palpate::datasets
