#include <volume/prepare/steps.h>

#include <base/error.h>
#include <base/folds.h>
#include <base/mapped.h>
#include <base/split.h>
#include <volume/clean.h>
#include <volume/resample.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <glm/common.hpp>
#include <glm/vector_relational.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <limits>

namespace palpate::prepare {

namespace {

using volume::LabelImage;
using volume::LabelName;
using volume::Role;

constexpr double maxVoxels = 4e9;  // after resampling or padding

// A label value that neither a voxel nor a name has.
std::uint16_t freeValue(const LabelImage& image, const std::vector<LabelName>& names, const char* option)
{
    std::vector<bool> used(65536, false);
    for (const std::uint16_t v : image.values) {
        used[v] = true;
    }
    for (const LabelName& n : names) {
        used[n.value] = true;
    }
    const auto at = std::find(used.begin() + 1, used.end(), false);
    base::failIf(at == used.end(), "{}: every label value from 1 to 65535 is in use: save the labels with fewer", option);
    return static_cast<std::uint16_t>(at - used.begin());
}

class Preparation {
public:
    Preparation(LabelImage& image, std::vector<LabelName>& names, const volume::TissueTable& table,
                const PreparationOptions& options, const std::function<void(const std::string&)>& tell)
        : image_(image), names_(names), table_(table), options_(options), tell_(tell)
    {
    }

    std::vector<PreparationStep> run()
    {
        if (!options_.crop.empty()) {
            crop();
        }
        if (options_.voxel > 0) {
            resample();
        }
        if (options_.largest) {
            keepLargest();
        }
        if (options_.closeSkinHoles) {
            closeHoles();
        }
        if (options_.addSkin > 0) {
            addSkin();
        }
        if (options_.pad > 0) {
            pad();
        }
        return std::move(steps_);
    }

private:
    std::string nameOf(std::uint16_t value) const
    {
        const auto at = std::find_if(names_.begin(), names_.end(), [&](const LabelName& n) { return n.value == value; });
        return at != names_.end() ? at->name : value == 0 ? "outside" : fmt::format("label {}", value);
    }

    Role roleOf(const LabelName& label) const
    {
        const auto row = table_.find(label.tissue);
        return row ? table_.rows[*row].role : Role::plain;
    }

    // Marks the labels of a structure, else those of a tissue (65536 x 1).
    std::vector<std::uint8_t> labelsNamed(const std::string& option, const std::string& wanted) const
    {
        std::vector<std::uint8_t> byName(65536, 0), byTissue(65536, 0);
        std::vector<std::string> all;
        bool named = false, made = false;
        for (const LabelName& n : names_) {
            byName[n.value] = n.name == wanted ? 1 : 0;
            byTissue[n.value] = n.tissue == wanted ? 1 : 0;
            named = named || n.name == wanted;
            made = made || n.tissue == wanted;
            all.push_back(n.name);
        }
        base::failIf(!named && !made, "{} {}: there is no structure or tissue of this name; there are {}", option, wanted,
                     fmt::join(all, ", "));
        return named ? byName : byTissue;
    }

    // 1 for labels without tissue (65536 x 1).
    std::vector<std::uint8_t> air() const
    {
        std::vector<std::uint8_t> out(65536, 0);
        out[0] = 1;
        for (const LabelName& n : names_) {
            out[n.value] = roleOf(n) == Role::air ? 1 : 0;
        }
        return out;
    }

    volume::SkinLabels skin() const
    {
        volume::SkinLabels out{air(), 0, std::vector<std::uint8_t>(65536, 0)};
        for (const LabelName& n : names_) {
            if (roleOf(n) == Role::skin) {
                out.isSkin[n.value] = 1;
                out.skin = out.skin == 0 ? n.value : out.skin;
            }
        }
        return out;
    }

    double volumeOf(std::uint64_t voxels) const { return static_cast<double>(voxels) * image_.affine.voxelVolume(); }

    void report(const std::string& step, const std::string& structure, std::uint64_t voxels, const std::string& text)
    {
        steps_.push_back({step, structure, text, voxels, volumeOf(voxels), 0, ""});
    }

    std::string amount(std::uint64_t voxels) const
    {
        return fmt::format("{} voxels ({:.3g} ml)", voxels, 1e6 * volumeOf(voxels));
    }

    // The box of all voxels for which wanted(value), or an empty one.
    template <typename Wanted>
    std::pair<Index3, Index3> boxOf(const Wanted& wanted) const
    {
        Index3 low = image_.size, high(-1);
        volume::forEachIndex(Index3(0), image_.size - 1, [&](Index3 n) {
            if (wanted(image_.values[image_.offset(n)])) {
                low = glm::min(low, n);
                high = glm::max(high, n);
            }
        });
        return {low, high};
    }

    // "x0,x1,y0,y1,z0,z1" in mm, patient frame, as voxels whose centres lie inside; nothing when it is no such text.
    std::optional<std::pair<Index3, Index3>> boxFromText() const
    {
        const auto numbers = base::mapped<std::optional<double>>(base::splitAt(',', options_.crop), base::numberIn<>);
        if (numbers.size() != 6 || !std::ranges::all_of(numbers, [](const auto& number) { return number.has_value(); })) {
            return std::nullopt;
        }
        const auto mm = base::mapped<double>(numbers, [](const auto& number) { return *number; });
        const Vec3 low = 1e-3 * Vec3(mm[0], mm[2], mm[4]), high = 1e-3 * Vec3(mm[1], mm[3], mm[5]);
        base::failIf(glm::any(glm::greaterThanEqual(low, high)),
                     "--crop {}: must be x0,x1,y0,y1,z0,z1 in mm, each first one less than its second", options_.crop);
        Vec3 first(std::numeric_limits<double>::max()), last(std::numeric_limits<double>::lowest());
        for (int corner = 0; corner < 8; ++corner) {
            const Vec3 n =
                image_.affine.toIndex(Vec3((corner & 1) != 0 ? high.x : low.x, (corner & 2) != 0 ? high.y : low.y,
                                           (corner & 4) != 0 ? high.z : low.z));
            first = glm::min(first, n);
            last = glm::max(last, n);
        }
        // No whole number can be made of a place that is far away.
        const auto near = [&](Vec3 n) { return glm::clamp(n, Vec3(-1.0), Vec3(image_.size)); };
        return std::pair(Index3(glm::ceil(near(first - 1e-6))), Index3(glm::floor(near(last + 1e-6))));
    }

    // Where the voxels are, for a message.
    std::string extentText() const
    {
        Vec3 low(std::numeric_limits<double>::max()), high(std::numeric_limits<double>::lowest());
        for (int corner = 0; corner < 8; ++corner) {
            const Vec3 n = Vec3(image_.size - 1) * Vec3(corner & 1, (corner >> 1) & 1, (corner >> 2) & 1);
            low = glm::min(low, image_.affine.toPatient(n));
            high = glm::max(high, image_.affine.toPatient(n));
        }
        return fmt::format("they lie in {:.1f},{:.1f},{:.1f},{:.1f},{:.1f},{:.1f} mm (LPS)", 1e3 * low.x, 1e3 * high.x,
                           1e3 * low.y, 1e3 * high.y, 1e3 * low.z, 1e3 * high.z);
    }

    void crop()
    {
        tell_("cropping");
        auto box = boxFromText();
        if (!box) {
            const auto outside = air();
            const auto wanted =
                options_.crop == "tissue" ? std::vector<std::uint8_t>{} : labelsNamed("--crop", options_.crop);
            box = boxOf([&](std::uint16_t v) { return wanted.empty() ? outside[v] == 0 : wanted[v] != 0; });
            const Index3 margin(glm::ceil(options_.cropMargin / image_.affine.spacing() - 1e-6));
            if (box->second.x >= 0) {
                *box = {box->first - margin, box->second + margin};
            }
        }
        const Index3 low = glm::max(box->first, Index3(0)), high = glm::min(box->second, image_.size - 1);
        base::failIf(glm::any(glm::lessThan(high, low)), "--crop {}: no voxel lies there; {}", options_.crop, extentText());
        const std::size_t before = image_.values.size();
        image_ = volume::cropped(image_, low, high);
        const Index3 n = image_.size;
        report("crop", "", before - image_.values.size(),
               fmt::format("cropped to {} x {} x {} voxels around {}", n.x, n.y, n.z, options_.crop));
    }

    void resample()
    {
        const volume::VoxelGrid grid = volume::isotropicGrid({image_.size, image_.affine}, options_.voxel);
        const double count = static_cast<double>(grid.size.x) * grid.size.y * grid.size.z;
        base::failIf(!(count < maxVoxels),
                     "--voxel {:g}mm: makes {} x {} x {} voxels, over 4 thousand million: choose "
                     "larger ones, or --crop",
                     1e3 * options_.voxel, grid.size.x, grid.size.y, grid.size.z);
        volume::ResampledLabels out = volume::resampled(
            image_, grid, [&](double fraction) { tell_(fmt::format("resampling: {:.0f} %", 100 * fraction)); });
        image_ = std::move(out.image);
        report("resample", "", image_.values.size(),
               fmt::format("resampled to {} x {} x {} voxels of {:g} mm", grid.size.x, grid.size.y, grid.size.z,
                           1e3 * options_.voxel));
        for (const volume::StructureChange& change : out.changes) {
            steps_.push_back(stepOf(change));
        }
    }

    PreparationStep stepOf(const volume::StructureChange& change) const
    {
        const std::string regained = change.beside ? ", other structures have its voxels: it has one beside them"
                                     : change.regained > 0
                                         ? fmt::format(", {} voxels given back to it: it is thin", change.regained)
                                         : "";
        PreparationStep step{"resample", nameOf(change.value), "", change.regained, change.after, change.before, ""};
        step.text = fmt::format("{}: {:.4g} ml -> {:.4g} ml ({:+.2f} %){}", step.structure, 1e6 * change.before,
                                1e6 * change.after, 100 * (change.after / change.before - 1), regained);
        if (change.after == 0) {
            step.warning = fmt::format(
                "'{}' ({:.3g} ml) is lost: other structures have all voxels of {:g} mm that it is in: "
                "resample to smaller ones",
                step.structure, 1e6 * change.before, 1e3 * options_.voxel);
        }
        return step;
    }

    void keepLargest()
    {
        tell_("looking for loose pieces");
        std::vector<std::uint8_t> wanted = air();
        for (std::uint8_t& w : wanted) {
            w = w == 0 && options_.largestOf.empty() ? 1 : 0;
        }
        for (const std::string& name : options_.largestOf) {
            const auto labels = labelsNamed("--largest-component", name);
            std::transform(labels.begin(), labels.end(), wanted.begin(), wanted.begin(),
                           [](std::uint8_t a, std::uint8_t b) { return static_cast<std::uint8_t>(a | b); });
        }
        const auto taken = volume::keepLargestPieces(image_, wanted);
        for (const volume::Relabelled& r : taken) {
            report("largest-component", nameOf(r.value), r.voxels,
                   fmt::format("{}: {} loose pieces, {}, are now what is around them", nameOf(r.value), r.pieces,
                               amount(r.voxels)));
        }
        if (taken.empty()) {
            report("largest-component", "", 0, "no loose pieces");
        }
    }

    void closeHoles()
    {
        tell_("closing holes in the skin");
        const volume::SkinLabels labels = skin();
        base::failIf(labels.skin == 0, "--close-skin-holes: nothing in the volume is skin: make one with --add-skin");
        const volume::ClosedHoles holes = volume::closeSkinHoles(image_, labels, *options_.closeSkinHoles);
        report("close-skin-holes", "", 0,
               fmt::format("{} holes in the skin closed, {:.2g} mm deep; {} left that are over {:g} mm across{}",
                           holes.closed, 1e3 * holes.thickness, holes.left, 1e3 * *options_.closeSkinHoles,
                           holes.left > 0 ? fmt::format(", the largest {:.0f} mm", 1e3 * holes.largestLeft) : ""));
        reportTaken("close-skin-holes", holes.taken);
    }

    void addSkin()
    {
        tell_("adding skin");
        volume::SkinLabels labels = skin();
        if (labels.skin == 0) {
            labels.skin = freeValue(image_, names_, "--add-skin");
            labels.isSkin[labels.skin] = 1;
            names_.push_back({labels.skin, "skin", skinTissue()});
        }
        const volume::AddedSkin added = volume::addSkin(image_, labels, options_.addSkin);
        const auto all = base::sumOf(added.taken, &volume::Relabelled::voxels, std::uint64_t{0});
        const std::string thickness =
            all == 0 ? "no tissue has a face to the outside, or all that has is skin"
            : added.thickness > 0
                ? fmt::format("it is {:.2g} mm thick on average, {:g} mm were asked for", 1e3 * added.thickness,
                              1e3 * options_.addSkin)
                : fmt::format("{:g} mm were asked for, and no other tissue is under it", 1e3 * options_.addSkin);
        report("add-skin", "skin", all, fmt::format("{} became skin: {}", amount(all), thickness));
        const Vec3 spacing = image_.affine.spacing();
        if (const double widest = std::max({spacing.x, spacing.y, spacing.z});
            all > 0 && widest > options_.addSkin * (1 + 1e-6)) {
            steps_.back().warning = fmt::format(
                "skin of {:g} mm was asked for, but voxels are up to {:.3g} mm wide: it is a "
                "voxel thick there",
                1e3 * options_.addSkin, 1e3 * widest);
        }
        reportTaken("add-skin", added.taken);
    }

    void reportTaken(const std::string& step, const std::vector<volume::Relabelled>& taken)
    {
        for (const volume::Relabelled& r : taken) {
            report(step, nameOf(r.value), r.voxels, fmt::format("{}: {} are skin now", nameOf(r.value), amount(r.voxels)));
        }
    }

    std::string skinTissue() const
    {
        if (const auto skin = std::ranges::find(table_.rows, Role::skin, &volume::TissueRow::role);
            skin != table_.rows.end()) {
            return skin->name;
        }
        throw base::error("--add-skin: the tissue table '{}' has no tissue of role skin: add one to it", table_.name);
    }

    void pad()
    {
        const Index3 by(glm::ceil(options_.pad / image_.affine.spacing() - 1e-6));
        const Vec3 size = Vec3(image_.size + 2 * by);
        base::failIf(!(size.x * size.y * size.z < maxVoxels),
                     "--pad {:g}mm: makes over 4 thousand million voxels: choose less, or larger voxels",
                     1e3 * options_.pad);
        const std::size_t before = image_.values.size();
        image_ = volume::padded(image_, by);
        report("pad", "", image_.values.size() - before,
               fmt::format("{} x {} x {} voxels of outside added on either side", by.x, by.y, by.z));
    }

    LabelImage& image_;
    std::vector<LabelName>& names_;
    const volume::TissueTable& table_;
    const PreparationOptions& options_;
    const std::function<void(const std::string&)>& tell_;
    std::vector<PreparationStep> steps_;
};

}  // namespace

std::vector<PreparationStep> separateOutside(LabelImage& image, std::vector<LabelName>& names,
                                             const volume::TissueTable& table)
{
    const auto zero = std::ranges::find(names, std::uint16_t{0}, &LabelName::value);
    const auto row = zero != names.end() ? table.find(zero->tissue) : std::nullopt;
    if (!row || table.rows[*row].role == Role::air) {
        return {};
    }
    zero->value = freeValue(image, names, "label 0 is tissue");
    zero->name = zero->name == "outside" ? "label 0" : zero->name;
    std::ranges::replace(image.values, std::uint16_t{0}, zero->value);
    const auto voxels = static_cast<std::uint64_t>(std::ranges::count(image.values, zero->value));
    return {{"separate-outside", zero->name,
             fmt::format("{}: has label {} now, not 0: voxels that are added are outside", zero->name, zero->value), voxels,
             static_cast<double>(voxels) * image.affine.voxelVolume(), 0, ""}};
}

std::vector<PreparationStep> prepare(LabelImage& image, std::vector<LabelName>& names, const volume::TissueTable& table,
                                     const PreparationOptions& options, const std::function<void(const std::string&)>& tell)
{
    return Preparation(image, names, table, options, tell).run();
}

nlohmann::json stepFigures(const std::vector<PreparationStep>& steps)
{
    nlohmann::json out = nlohmann::json::array();
    for (const PreparationStep& s : steps) {
        out.push_back({{"step", s.step},
                       {"structure", s.structure},
                       {"voxels", s.voxels},
                       {"volume_ml", 1e6 * s.volume},
                       {"text", s.text}});
        if (s.before > 0) {
            out.back()["before_ml"] = 1e6 * s.before;
            out.back()["change_pct"] = 100 * (s.volume / s.before - 1);
        }
    }
    return out;
}

}  // namespace palpate::prepare
