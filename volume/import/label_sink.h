#pragma once

#include <volume/import.h>

#include <filesystem>
#include <map>
#include <set>
#include <span>
#include <string>
#include <vector>

// Inside volume/import/ only: from the numbers of a file to labels.
namespace palpate::volume {

/// What is done with numbers that are no labels, whole from 0 to 65535.
struct LabelRules {
    bool scaled = false;    // they went through a slope, which leaves a rounding of single precision
    bool round = false;     // take the whole number that is within 0.001
    bool renumber = false;  // give negative ones and those over 65535 free values

    LabelRules(bool scaledValues, const ImportOptions& options)
        : scaled(scaledValues), round(options.round), renumber(options.renumber)
    {
    }
};

/// Turns values into labels, one after another, and refuses what no label map holds. The reason is given at the end, when
/// all values are known: few numbers over 65535 are labels of another numbering, many different ones are an image.
class LabelSink {
public:
    LabelSink(std::filesystem::path file, Index3 size, LabelRules rules);

    void add(std::span<const double> values);
    /// Refuses images (too many different values) and empty maps. Sets the voxels of `out` and what was renumbered, to
    /// values that `out` has no name for, and adds a warning for what was changed. `surelyLabels`: the file says itself
    /// that it is a label map.
    void finish(bool surelyLabels, ImportedLabels& out);

    /// One value at once; what is no label is refused, renumbering or not.
    static std::uint16_t label(const std::filesystem::path& file, double value, LabelRules rules, const std::string& voxel);

private:
    /// A number that is no label.
    struct Odd {
        std::string voxel;
        double value = 0;
    };

    void addOdd(double value);
    void addWhole(double whole);
    std::string here() const;
    [[noreturn]] void refuseOdd(bool surelyLabels) const;
    std::size_t different() const;
    std::vector<std::uint16_t> decoded(ImportedLabels& out) const;

    std::filesystem::path file_;
    Index3 size_;
    LabelRules rules_;
    std::vector<std::uint16_t> labels_;  // with rules_.renumber: places in values_
    std::vector<bool> seen_;
    std::map<std::int64_t, std::uint16_t> codes_;  // with rules_.renumber: value, its place in values_
    std::vector<std::int64_t> values_;
    std::set<double> oddValues_;  // up to one more than a label map may have
    std::optional<Odd> fraction_, outside_;
    double farthest_ = 0;  // from a whole number
    std::uint64_t fractions_ = 0;
};

}  // namespace palpate::volume
