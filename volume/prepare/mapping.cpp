#include <volume/prepare/mapping.h>

#include <base/outputs.h>
#include <datasets/label_map.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <functional>
#include <optional>
#include <set>
#include <stdexcept>

namespace palpate::prepare {

namespace {

using datasets::LabelMap;
using volume::LabelName;

constexpr std::size_t mostListed = 40;  // labels in a message
constexpr std::size_t mostContradictions = 8;

const LabelName* find(const std::vector<LabelName>& names, std::uint16_t value)
{
    const auto found = std::find_if(names.begin(), names.end(), [&](const LabelName& n) { return n.value == value; });
    return found == names.end() ? nullptr : &*found;
}

// Whether a name is more than the value: some programs, and our own export, write "label 3" where they know none.
bool tells(const LabelName& label)
{
    const std::string number = std::to_string(label.value);
    return !label.name.empty() && label.name != number && label.name != "label " + number;
}

bool covers(const LabelMap& map, const LabelCounts& counts)
{
    return std::all_of(counts.begin(), counts.end(),
                       [&](const auto& label) { return label.first == 0 || find(map.labels, label.first) != nullptr; });
}

// The file's own names agree with the map's for every label that is there.
bool namesAgree(const LabelMap& map, const std::vector<LabelName>& names, const LabelCounts& counts)
{
    return std::all_of(counts.begin(), counts.end(), [&](const auto& label) {
        const LabelName* ours = find(map.labels, label.first);
        const LabelName* theirs = find(names, label.first);
        return label.first == 0 || (ours != nullptr && theirs != nullptr && ours->name == theirs->name);
    });
}

// The built-in map that the file was certainly made by, or an empty one. Names alone tell: 3, 11 and 20 are a kidney, a
// lung and a bowel to one segmenter, and bundles of white matter to another.
LabelMap recognise(const volume::ImportedLabels& labels, const LabelCounts& counts, std::vector<std::string>& notes)
{
    for (const std::string& name : datasets::labelMapNames()) {
        LabelMap map = datasets::labelMap(name);
        if (!labels.names.empty() && namesAgree(map, labels.names, counts)) {
            notes.push_back(fmt::format("label map '{}' recognised by the names in the file", name));
            return map;
        }
    }
    return {};
}

// The built-in maps that have all values of a file without names, and what each makes of its largest labels: for the user
// to choose from. Empty where there is none.
std::string offers(const volume::ImportedLabels& labels, const LabelCounts& counts)
{
    constexpr std::size_t mostShown = 4;  // labels
    std::vector<std::pair<std::uint64_t, std::uint16_t>> largest;
    for (const auto& [value, voxels] : counts) {
        if (const LabelName* own = find(labels.names, value); value != 0 && own != nullptr && tells(*own)) {
            return "";
        }
        if (value != 0) {
            largest.emplace_back(voxels, value);
        }
    }
    std::ranges::sort(largest, std::greater<>());
    largest.resize(std::min(largest.size(), mostShown));
    std::vector<std::string> list;
    for (const std::string& name : datasets::labelMapNames()) {
        const LabelMap map = datasets::labelMap(name);
        if (!covers(map, counts)) {
            continue;
        }
        std::vector<std::string> parts;
        for (const auto& [voxels, value] : largest) {
            parts.push_back(fmt::format("{} is {}", value, find(map.labels, value)->name));
        }
        list.push_back(fmt::format("--map {} ({})", name, fmt::join(parts, ", ")));
    }
    return list.empty() ? "" : fmt::format("; its values would fit {}: is it one of these?", fmt::join(list, ", or "));
}

// One --set: which label, by value or name, is made of what.
struct Setting {
    std::string text, label, tissue;

    bool names(std::uint16_t value, const std::string& name) const
    {
        return label == name || label == std::to_string(value);
    }
};

std::vector<std::string> tissuesOf(const volume::TissueTable& table)
{
    std::vector<std::string> names;
    for (const volume::TissueRow& row : table.rows) {
        names.push_back(row.name);
    }
    return names;
}

// The labels that are there, for a message.
std::string listOf(const volume::ImportedLabels& labels, const LabelCounts& counts)
{
    std::vector<std::string> list;
    for (const auto& [value, voxels] : counts) {
        if (list.size() == mostListed) {
            list.emplace_back("...");
            break;
        }
        const LabelName* own = find(labels.names, value);
        list.push_back(own == nullptr ? std::to_string(value) : fmt::format("{} '{}'", value, own->name));
    }
    return fmt::format("{}", fmt::join(list, ", "));
}

std::vector<Setting> readSettings(const MappingOptions& options, const volume::TissueTable& table)
{
    std::vector<Setting> settings;
    for (const std::string& text : options.set) {
        const std::size_t at = text.rfind('=');
        if (at == std::string::npos || at == 0 || at + 1 == text.size()) {
            throw std::runtime_error(fmt::format("--set {}: must be NAME=TISSUE or VALUE=TISSUE", text));
        }
        settings.push_back({text, text.substr(0, at), text.substr(at + 1)});
        if (!table.find(settings.back().tissue)) {
            throw std::runtime_error(fmt::format("--set {}: '{}' is not in the tissue table '{}'; it has: {}", text,
                                                 settings.back().tissue, table.name, fmt::join(tissuesOf(table), ", ")));
        }
    }
    return settings;
}

// What a label is made of, and how that is known.
struct Found {
    LabelName label;
    bool certain = true;  // else `label.tissue` is a suggestion, or empty
    bool byItsName = false;
};

class Mapper {
public:
    Mapper(const MappingOptions& options, const std::filesystem::path& file, const volume::ImportedLabels& labels,
           const LabelCounts& counts, const volume::TissueTable& table, std::vector<std::string>& notes)
        : labels_(labels),
          table_(table),
          settings_(readSettings(options, table)),
          map_(options.map.empty() ? recognise(labels, counts, notes) : datasets::labelMap(options.map))
    {
        const auto there = [&](const Setting& s) {
            return std::any_of(counts.begin(), counts.end(), [&](const auto& label) {
                const LabelName* own = find(labels.names, label.first);
                return s.names(label.first, own != nullptr ? own->name : "");
            });
        };
        for (const Setting& s : settings_) {
            if (!there(s)) {
                throw std::runtime_error(fmt::format("--set {}: no voxel has a label of that name or value; there are {}",
                                                     s.text, listOf(labels, counts)));
            }
        }
        if (!options.map.empty()) {
            checkNames(options.map, file, counts);
        }
    }

    Found tissueOf(std::uint16_t value) const
    {
        const LabelName* own = find(labels_.names, value);
        const LabelName* mapped = find(map_.labels, value);
        Found found;
        found.label = own != nullptr ? *own : LabelName{value, "", ""};
        std::string& name = found.label.name;
        if (mapped != nullptr && !mapped->name.empty()) {
            name = mapped->name;
        }
        if (name.empty()) {
            name = value == 0 ? "outside" : fmt::format("label {}", value);
        }
        for (const Setting& s : settings_) {
            if (s.names(value, own != nullptr ? own->name : "")) {
                found.label.tissue = s.tissue;
                return found;
            }
        }
        const auto segment = std::find_if(map_.segments.begin(), map_.segments.end(),
                                          [&](const auto& s) { return own != nullptr && s.first == own->name; });
        if (mapped != nullptr || segment != map_.segments.end()) {
            found.label.tissue = mapped != nullptr ? mapped->tissue : segment->second;
            return found;
        }
        if (own != nullptr) {
            searchByName(own->name, found);
        } else {
            found.certain = false;
        }
        return found;
    }

private:
    // A map that calls a label something else than the file does, and makes something else of it, is the map of another
    // program.
    void checkNames(const std::string& map, const std::filesystem::path& file, const LabelCounts& counts) const
    {
        std::vector<std::string> list;
        for (const auto& [value, voxels] : counts) {
            const LabelName* own = find(labels_.names, value);
            const LabelName* mapped = find(map_.labels, value);
            if (value == 0 || own == nullptr || mapped == nullptr || mapped->name.empty() || mapped->name == own->name) {
                continue;
            }
            Found byName;
            searchByName(own->name, byName);
            const bool said =
                std::ranges::any_of(settings_, [&, v = value](const Setting& s) { return s.names(v, own->name); });
            if (!said && byName.certain && byName.label.tissue != mapped->tissue) {
                list.push_back(fmt::format("{} is '{}' ({}) in the file and '{}' ({}) in the map", value, own->name,
                                           byName.label.tissue, mapped->name, mapped->tissue));
            }
        }
        if (list.empty()) {
            return;
        }
        const std::size_t all = list.size();
        if (all > mostContradictions) {
            list.resize(mostContradictions);
            list.push_back(fmt::format("and {} more", all - mostContradictions));
        }
        throw std::runtime_error(fmt::format(
            "{}: --map {} contradicts the names in it: {}: leave out --map, or give that of the program that made it",
            file.string(), map, fmt::join(list, "; ")));
    }

    void searchByName(const std::string& name, Found& found) const
    {
        const auto inTable = [&](const std::optional<std::string>& tissue) {
            return tissue && table_.find(*tissue) ? *tissue : std::string();
        };
        found.label.tissue = inTable(name);
        if (!found.label.tissue.empty()) {
            return;
        }
        found.label.tissue = inTable(names_.tissueOf(name));
        found.byItsName = !found.label.tissue.empty();
        if (!found.byItsName) {
            found.label.tissue = inTable(names_.suggestion(name));
            found.certain = false;
        }
    }

    const volume::ImportedLabels& labels_;
    const volume::TissueTable& table_;
    std::vector<Setting> settings_;
    LabelMap map_;
    datasets::StructureNames names_;
};

[[noreturn]] void refuseUnknown(const std::filesystem::path& file, const volume::ImportedLabels& labels,
                                const std::vector<Found>& unknown, const LabelCounts& counts)
{
    std::vector<std::string> list;
    for (const Found& u : unknown) {
        const std::string perhaps = u.label.tissue.empty() ? "" : fmt::format(", perhaps {}", u.label.tissue);
        list.push_back(fmt::format("{}{} ({} voxels{})", u.label.value,
                                   u.label.name.rfind("label ", 0) == 0 ? "" : fmt::format(" '{}'", u.label.name),
                                   counts.at(u.label.value), perhaps));
        if (list.size() == mostListed && unknown.size() > mostListed) {
            list.push_back(fmt::format("and {} more", unknown.size() - mostListed));
            break;
        }
    }
    throw std::runtime_error(
        fmt::format("{}: no tissue is known for {} of its labels: {}: give --map ({} or a TOML file), --set "
                    "NAME=TISSUE, or --default-tissue NAME; --write-map FILE begins a label map{}",
                    file.string(), unknown.size(), fmt::join(list, ", "), fmt::join(datasets::labelMapNames(), ", "),
                    offers(labels, counts)));
}

}  // namespace

LabelCounts countLabels(const volume::LabelImage& image)
{
    std::vector<std::uint64_t> histogram(65536, 0);
    for (const std::uint16_t value : image.values) {
        ++histogram[value];
    }
    LabelCounts counts;
    for (std::size_t v = 0; v < histogram.size(); ++v) {
        if (histogram[v] > 0) {
            counts[static_cast<std::uint16_t>(v)] = histogram[v];
        }
    }
    return counts;
}

std::vector<LabelName> mapLabels(const MappingOptions& options, const std::filesystem::path& file,
                                 const volume::ImportedLabels& labels, const LabelCounts& counts,
                                 const volume::TissueTable& table, std::vector<std::string>& notes)
{
    if (!options.defaultTissue.empty() && !table.find(options.defaultTissue)) {
        throw std::runtime_error(fmt::format("--default-tissue {}: is not in the tissue table '{}'; it has: {}",
                                             options.defaultTissue, table.name, fmt::join(tissuesOf(table), ", ")));
    }
    const Mapper mapper(options, file, labels, counts, table, notes);
    std::vector<LabelName> named;
    std::vector<Found> unknown;
    for (const auto& [value, voxels] : counts) {
        Found found = mapper.tissueOf(value);
        if (found.certain) {
            if (found.byItsName) {
                notes.push_back(
                    fmt::format("label {} '{}' is taken as {} by its name", value, found.label.name, found.label.tissue));
            }
            named.push_back(std::move(found.label));
        } else if (value != 0 && !options.defaultTissue.empty()) {
            found.label.tissue = options.defaultTissue;
            notes.push_back(fmt::format("label {} ({} voxels) is taken as {}", value, voxels, options.defaultTissue));
            named.push_back(std::move(found.label));
        } else if (value != 0) {
            unknown.push_back(std::move(found));
        }
    }
    if (!unknown.empty()) {
        refuseUnknown(file, labels, unknown, counts);
    }
    return named;
}

std::size_t writeLabelMap(const MappingOptions& options, const std::filesystem::path& file,
                          const volume::ImportedLabels& labels, const LabelCounts& counts, const volume::TissueTable& table)
{
    std::vector<std::string> notes;
    const Mapper mapper(options, file, labels, counts, table, notes);
    LabelMap map{file.stem().string(), {}, {}};
    std::set<std::uint16_t> open;
    for (const auto& [value, voxels] : counts) {
        Found found = mapper.tissueOf(value);
        if (value == 0 && found.label.tissue.empty()) {
            continue;
        }
        if (!found.certain) {
            open.insert(value);
            found.label.tissue = found.label.tissue.empty() ? "?" : "? " + found.label.tissue;
        }
        map.labels.push_back(std::move(found.label));
    }
    std::string text =
        fmt::format("# Which tissue each label of {} is: replace every \"?\" by a row of the tissue table.\n",
                    file.filename().string());
    base::writeWhole(options.writeMap, text + datasets::labelMapText(map));
    return open.size();
}

}  // namespace palpate::prepare
