#include <volume/import/label_sink.h>
#include <volume/import/source.h>

#include <algorithm>
#include <cmath>

namespace palpate::volume {

namespace {

constexpr std::size_t maxDifferent = 1024;  // more different values than this is an image
constexpr double maxLabel = 65535;
constexpr double roundable = 1e-3;             // how far from a whole number --round reaches
constexpr double maxExact = 9007199254740992;  // 2^53: from it on a double may be another whole number
constexpr std::size_t maxNamed = 5;            // labels in a warning

double allowed(const LabelRules& rules, double value)
{
    // A slope that is no power of two leaves a rounding of single precision.
    return rules.scaled ? 1e-6 * std::max(1.0, std::abs(value)) : 0.0;
}

[[noreturn]] void refuseNan(const std::filesystem::path& file, const std::string& voxel, double value)
{
    refuse(file,
           "{} is not a number ({}): a label map holds whole numbers from 0 to 65535, give the "
           "segmentation",
           voxel, value);
}

[[noreturn]] void refuseFraction(const std::filesystem::path& file, const std::string& voxel, double value, bool scaled)
{
    refuse(file,
           "{} is {:.7g}: a label map holds whole numbers from 0 to 65535, this is an image or a "
           "probability{}: give the segmentation",
           voxel, value, scaled ? " (its slope is applied)" : "");
}

}  // namespace

LabelSink::LabelSink(std::filesystem::path file, Index3 size, LabelRules rules)
    : file_(std::move(file)), size_(size), rules_(rules), seen_(65536, false)
{
    labels_.reserve(base::countOf(size));
}

std::string LabelSink::here() const
{
    const auto nx = static_cast<std::size_t>(size_.x);
    const auto ny = static_cast<std::size_t>(size_.y);
    const std::size_t at = labels_.size();
    return fmt::format("voxel ({}, {}, {})", at % nx, at / nx % ny, at / nx / ny);
}

std::uint16_t LabelSink::label(const std::filesystem::path& file, double value, LabelRules rules, const std::string& voxel)
{
    if (!std::isfinite(value)) {
        refuseNan(file, voxel, value);
    }
    const double whole = std::round(value);
    refuseIf(whole < 0 || whole > maxLabel, file,
             "{} is {:.7g}: a label map holds whole numbers from 0 to 65535, so this is not a label map but "
             "an image: give the segmentation that was made of it",
             voxel, value);
    if (std::abs(value - whole) > std::max(allowed(rules, value), rules.round ? roundable : 0.0)) {
        refuseFraction(file, voxel, value, rules.scaled);
    }
    return static_cast<std::uint16_t>(whole);
}

void LabelSink::add(std::span<const double> values)
{
    for (const double value : values) {
        // In a label map nothing else happens.
        const auto plain = value >= 0 && value <= maxLabel ? static_cast<std::uint16_t>(value) : std::uint16_t{0};
        if (static_cast<double>(plain) == value && !rules_.renumber) {
            labels_.push_back(plain);
            seen_[plain] = true;
        } else {
            addOdd(value);
        }
    }
}

void LabelSink::addOdd(double value)
{
    if (!std::isfinite(value)) {
        refuseNan(file_, here(), value);
    }
    const double whole = std::round(value);
    const double off = std::abs(value - whole);
    if (off > allowed(rules_, value)) {
        farthest_ = std::max(farthest_, off);
        ++fractions_;
        if (!rules_.round || off > roundable) {
            fraction_ = fraction_ ? fraction_ : std::optional(Odd{here(), value});
        }
    }
    addWhole(whole);
}

void LabelSink::addWhole(double whole)
{
    const bool fits = whole >= 0 && whole <= maxLabel;
    if (rules_.renumber) {
        const bool exact = std::abs(whole) < maxExact;
        if (!exact) {
            outside_ = outside_ ? outside_ : std::optional(Odd{here(), whole});
        }
        const auto value = exact ? static_cast<std::int64_t>(whole) : 0;
        // Label maps are made of long runs.
        if (!labels_.empty() && values_[labels_.back()] == value) {
            labels_.push_back(labels_.back());
            return;
        }
        const auto known = codes_.emplace(value, static_cast<std::uint16_t>(values_.size()));
        if (known.second) {
            refuseIf(values_.size() > 65535, file_,
                     "has more than 65536 different values, so it is an image: give the segmentation");
            values_.push_back(value);
        }
        labels_.push_back(known.first->second);
        return;
    }
    if (!fits) {
        outside_ = outside_ ? outside_ : std::optional(Odd{here(), whole});
        if (oddValues_.size() <= maxDifferent) {
            oddValues_.insert(whole);
        }
    }
    labels_.push_back(fits ? static_cast<std::uint16_t>(whole) : std::uint16_t{0});
    seen_[labels_.back()] = true;
}

std::size_t LabelSink::different() const
{
    return rules_.renumber ? values_.size()
                           : static_cast<std::size_t>(std::count(seen_.begin(), seen_.end(), true)) + oddValues_.size();
}

// What is wrong with all of it, not with the first voxel alone.
void LabelSink::refuseOdd(bool surelyLabels) const
{
    if (fraction_ && (farthest_ > roundable || rules_.round)) {
        refuseFraction(file_, fraction_->voxel, fraction_->value, rules_.scaled);
    }
    if (fraction_) {
        refuse(file_,
               "{} is {:.9g}, and {} voxels like it are up to {:.2g} off a whole number: --round takes "
               "the whole number",
               fraction_->voxel, fraction_->value, fractions_, farthest_);
    }
    refuseIf(different() > maxDifferent && !surelyLabels, file_,
             "{} is {:.7g}: a label map holds whole numbers from 0 to 65535, so this is not a label map but "
             "an image: give the segmentation that was made of it",
             outside_->voxel, outside_->value);
    refuseIf(std::abs(outside_->value) >= maxExact, file_,
             "{} is {:.17g}: whole numbers from 2^53 on cannot be told apart, save it with smaller ones", outside_->voxel,
             outside_->value);
    refuse(file_,
           "{} is {:.17g}: a label is a whole number from 0 to 65535; if this is a label map, --renumber "
           "gives such labels free values; if it is an image, give the segmentation that was made of it",
           outside_->voxel, outside_->value);
}

// The labels of codes: values from 0 to 65535 stay, others take the lowest that are free, in rising order. One that the
// file names is not free, though no voxel has it.
std::vector<std::uint16_t> LabelSink::decoded(ImportedLabels& out) const
{
    std::vector<std::uint16_t> labelOf(values_.size());
    std::vector<bool> used(65536, false);
    used[0] = true;
    for (const LabelName& named : out.names) {
        used[named.value] = true;
    }
    for (const auto& [value, code] : codes_) {
        if (value >= 0 && value <= 65535) {
            labelOf[code] = static_cast<std::uint16_t>(value);
            used[labelOf[code]] = true;
        }
    }
    std::vector<std::string> said;
    auto free = used.begin();
    for (const auto& [value, code] : codes_) {
        if (value >= 0 && value <= 65535) {
            continue;
        }
        free = std::find(free, used.end(), false);
        refuseIf(free == used.end(), file_,
                 "--renumber: every label value from 1 to 65535 is in use: save it with fewer labels");
        *free = true;
        labelOf[code] = static_cast<std::uint16_t>(free - used.begin());
        out.renumbered.push_back({value, labelOf[code]});
        if (said.size() < maxNamed) {
            said.push_back(fmt::format("{} is {}", value, labelOf[code]));
        }
    }
    if (!out.renumbered.empty()) {
        out.warnings.push_back(fmt::format("{} labels are renumbered: {}{}", out.renumbered.size(), fmt::join(said, ", "),
                                           out.renumbered.size() > said.size() ? ", ..." : ""));
    }
    std::vector<std::uint16_t> labels(labels_.size());
    std::transform(labels_.begin(), labels_.end(), labels.begin(), [&](std::uint16_t code) { return labelOf[code]; });
    return labels;
}

void LabelSink::finish(bool surelyLabels, ImportedLabels& out)
{
    if (fraction_ || outside_) {
        refuseOdd(surelyLabels);
    }
    refuseIf(different() > maxDifferent && !surelyLabels, file_,
             "has {} different values, so it is not a label map (at most {}) but an image: give the "
             "segmentation that was made of it",
             different(), maxDifferent);
    if (fractions_ > 0) {
        out.warnings.push_back(
            fmt::format("{} voxels are rounded to whole numbers, by up to {:.2g}", fractions_, farthest_));
    }
    out.image.values = rules_.renumber ? decoded(out) : std::move(labels_);
    if (std::all_of(out.image.values.begin(), out.image.values.end(), [](std::uint16_t v) { return v == 0; })) {
        refuse(file_, "no voxel is set: every label is 0, give a segmentation that holds something");
    }
}

}  // namespace palpate::volume
