#include <base/error.h>
#include <base/mapped.h>
#include <base/outputs.h>
#include <datasets/label_map.h>
#include <volume/prepare/mapping.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <functional>
#include <optional>

namespace palpate::prepare {

namespace {

using datasets::LabelMap;
using volume::LabelName;

const LabelName* find(const std::vector<LabelName>& names, std::uint16_t value)
{
    const auto found = std::find_if(names.begin(), names.end(), [&](const LabelName& n) { return n.value == value; });
    return found == names.end() ? nullptr : &*found;
}

constexpr std::size_t maxLabels = 4;  // shown of each offer
constexpr std::size_t maxOffers = 6;

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
        return label.first == 0 || (ours != nullptr && theirs != nullptr && sameName(ours->name, theirs->name));
    });
}

bool sameTissues(const LabelMap& a, const LabelMap& b, const LabelCounts& counts)
{
    return std::all_of(counts.begin(), counts.end(), [&](const auto& label) {
        const LabelName* first = find(a.labels, label.first);
        const LabelName* second = find(b.labels, label.first);
        return label.first == 0 || (first != nullptr && second != nullptr && first->tissue == second->tissue);
    });
}

// The built-in map whose names and values are those of all labels, or null. Names alone tell: 3, 11 and 20 are a kidney, a
// lung and a bowel to one segmenter, and bundles of white matter to another. Null too where several maps fit that make
// different tissues of the labels.
const LabelMap* recognised(const volume::ImportedLabels& labels, const LabelCounts& counts)
{
    const LabelMap* found = nullptr;
    if (labels.names.empty() || !labels.renumbered.empty()) {
        return found;
    }
    for (const LabelMap& map : datasets::labelMaps()) {
        if (!namesAgree(map, labels.names, counts)) {
            continue;
        }
        if (found != nullptr && !sameTissues(*found, map, counts)) {
            return nullptr;
        }
        found = found == nullptr ? &map : found;
    }
    return found;
}

// The built-in maps that have all values of a file without names, those that have least beside them first, and what each
// makes of its largest labels: for the user to choose from. Empty where there is none.
std::string offers(const volume::ImportedLabels& labels, const LabelCounts& counts)
{
    std::vector<std::pair<std::uint64_t, std::uint16_t>> largest;
    for (const auto& [value, voxels] : counts) {
        if (const LabelName* own = find(labels.names, value); value != 0 && own != nullptr && tellsMore(*own)) {
            return "";
        }
        if (value != 0) {
            largest.emplace_back(voxels, value);
        }
    }
    if (!labels.renumbered.empty()) {
        return "";
    }
    std::ranges::sort(largest, std::greater<>());
    largest.resize(std::min(largest.size(), maxLabels));
    std::vector<const LabelMap*> fitting;
    for (const LabelMap& map : datasets::labelMaps()) {
        if (covers(map, counts)) {
            fitting.push_back(&map);
        }
    }
    std::ranges::stable_sort(fitting, {}, [](const LabelMap* map) { return map->labels.size(); });
    std::vector<std::string> list;
    for (std::size_t i = 0; i < std::min(fitting.size(), maxOffers); ++i) {
        const auto parts = base::mapped<std::string>(largest, [&](const auto& one) {
            return fmt::format("{} is {}", one.second, find(fitting[i]->labels, one.second)->name);
        });
        list.push_back(fmt::format("--map {} ({})", fitting[i]->name, fmt::join(parts, ", ")));
    }
    const std::string more =
        fitting.size() > maxOffers ? fmt::format(", or one of {} more", fitting.size() - maxOffers) : "";
    return list.empty() ? ""
                        : fmt::format("; its values would fit {}{}: is it one of these?", fmt::join(list, ", or "), more);
}

constexpr std::size_t maxListed = 40;  // labels in a message
constexpr std::size_t maxContradictions = 8;

// One --set: which label, by value or name, is made of what.
struct Setting {
    std::string text, label, tissue;

    // `original`: the value in the file, which --renumber may have changed.
    bool names(std::int64_t original, const std::string& name) const
    {
        return label == name || label == std::to_string(original);
    }
};

std::vector<std::string> tissuesOf(const volume::TissueTable& table)
{
    return base::mapped<std::string>(table.rows, &volume::TissueRow::name);
}

// The labels that are there, for a message.
std::string listOf(const volume::ImportedLabels& labels, const LabelCounts& counts)
{
    std::vector<std::string> list;
    for (const auto& [value, voxels] : counts) {
        if (list.size() == maxListed) {
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
        base::failIf(at == std::string::npos || at == 0 || at + 1 == text.size(),
                     "--set {}: must be NAME=TISSUE or VALUE=TISSUE", text);
        settings.push_back({text, text.substr(0, at), text.substr(at + 1)});
        if (!table.find(settings.back().tissue)) {
            throw base::error("--set {}: '{}' is not in the tissue table '{}'; it has: {}", text, settings.back().tissue,
                              table.name, fmt::join(tissuesOf(table), ", "));
        }
    }
    return settings;
}

// What a label is made of, and how that is known.
struct FoundLabel {
    LabelName label;
    bool certain = true;  // else `label.tissue` is a suggestion, or empty
    bool byItsName = false;
};

class Mapper {
public:
    Mapper(const MappingOptions& options, const std::filesystem::path& file, const volume::ImportedLabels& labels,
           const LabelCounts& counts, const volume::TissueTable& table, std::vector<std::string>& notes)
        : labels_(labels), table_(table), settings_(readSettings(options, table)), known_(recognised(labels, counts))
    {
        if (!options.map.empty()) {
            map_ = datasets::labelMap(options.map);
        } else if (known_ != nullptr) {
            map_ = *known_;
            notes.push_back(fmt::format("label map '{}' recognised by the names in the file", map_.name));
        }
        const auto there = [&](const Setting& s) {
            return std::any_of(counts.begin(), counts.end(), [&](const auto& label) { return fits(s, label.first); });
        };
        for (const Setting& s : settings_) {
            if (!there(s)) {
                throw base::error("--set {}: no voxel has a label of that name or value; there are {}", s.text,
                                  listOf(labels, counts));
            }
        }
        checkSettings(counts);
        if (!options.map.empty()) {
            checkNames(options.map, file, counts);
        }
    }

    FoundLabel tissueOf(std::uint16_t value) const
    {
        const LabelName* own = find(labels_.names, value);
        const LabelName* mapped = inMap(value);
        FoundLabel found;
        found.label = own != nullptr ? *own : LabelName{value, "", ""};
        std::string& name = found.label.name;
        if (mapped != nullptr && !mapped->name.empty()) {
            name = mapped->name;
        }
        if (name.empty()) {
            name = value == 0 ? "outside" : fmt::format("label {}", labels_.originalOf(value));
        }
        for (const Setting& s : settings_) {
            if (fits(s, value)) {
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
    // Whether a setting is about this label: by its value, by its name in the file, or else by that in the map.
    bool fits(const Setting& s, std::uint16_t value) const
    {
        const LabelName* own = find(labels_.names, value);
        const LabelName* mapped = inMap(value);
        return s.names(labels_.originalOf(value), own != nullptr ? own->name : mapped != nullptr ? mapped->name : "");
    }

    // Two settings of one label, perhaps by its name and by its value, have to agree.
    void checkSettings(const LabelCounts& counts) const
    {
        for (const auto& [value, voxels] : counts) {
            const Setting* first = nullptr;
            for (const Setting& s : settings_) {
                if (!fits(s, value)) {
                    continue;
                }
                if (first != nullptr && first->tissue != s.tissue) {
                    throw base::error("--set {} and --set {}: both name label {}: leave one out", first->text, s.text,
                                      labels_.originalOf(value));
                }
                first = &s;
            }
        }
    }

    // A value that --renumber gave says nothing about what the label is.
    const LabelName* inMap(std::uint16_t value) const
    {
        return labels_.originalOf(value) == value ? find(map_.labels, value) : nullptr;
    }

    // A map that calls a label something else than the file does, and makes something else of it, is the map of another
    // program.
    void checkNames(const std::string& map, const std::filesystem::path& file, const LabelCounts& counts) const
    {
        std::vector<std::string> list;
        for (const auto& [value, voxels] : counts) {
            const LabelName* own = find(labels_.names, value);
            const LabelName* mapped = inMap(value);
            if (value == 0 || own == nullptr || mapped == nullptr || mapped->name.empty() ||
                sameName(mapped->name, own->name)) {
                continue;
            }
            FoundLabel byName;
            searchByName(own->name, byName);
            if (known_ != nullptr) {
                byName.label.tissue = find(known_->labels, value)->tissue;
                byName.certain = true;
            }
            const bool said = std::ranges::any_of(
                settings_, [&, v = labels_.originalOf(value)](const Setting& s) { return s.names(v, own->name); });
            if (!said && byName.certain && byName.label.tissue != mapped->tissue) {
                list.push_back(fmt::format("{} is '{}' ({}) in the file and '{}' ({}) in the map", value, own->name,
                                           byName.label.tissue, mapped->name, mapped->tissue));
            }
        }
        if (list.empty()) {
            return;
        }
        const std::size_t all = list.size();
        if (all > maxContradictions) {
            list.resize(maxContradictions);
            list.push_back(fmt::format("and {} more", all - maxContradictions));
        }
        throw base::error(
            "{}: --map {} contradicts the names in it: {}: leave out --map, or give that of the program that made it",
            file.string(), map, fmt::join(list, "; "));
    }

    void searchByName(const std::string& name, FoundLabel& found) const
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
    const LabelMap* known_;  // the map that the names in the file are of, or null
    LabelMap map_;
    datasets::StructureNames names_;
};

[[noreturn]] void refuseUnknown(const std::filesystem::path& file, const volume::ImportedLabels& labels,
                                const std::vector<FoundLabel>& unknown, const LabelCounts& counts)
{
    std::vector<std::string> list;
    for (const FoundLabel& u : unknown) {
        const std::string perhaps = u.label.tissue.empty() ? "" : fmt::format(", perhaps {}", u.label.tissue);
        list.push_back(fmt::format("{}{} ({} voxels{})", u.label.value,
                                   tellsMore(u.label) ? fmt::format(" '{}'", u.label.name) : "", counts.at(u.label.value),
                                   perhaps));
        if (list.size() == maxListed && unknown.size() > maxListed) {
            list.push_back(fmt::format("and {} more", unknown.size() - maxListed));
            break;
        }
    }
    throw base::error(
        "{}: no tissue is known for {} of its labels: {}: give --map NAME (one that --list-maps lists, or a TOML "
        "file), --names FILE (a colour table or dataset.json), --set NAME=TISSUE, or --default-tissue NAME; "
        "--write-map FILE begins a label map{}",
        file.string(), unknown.size(), fmt::join(list, ", "), offers(labels, counts));
}

// One note for all that happened to several labels, or with --verbose each its own.
void sumUp(const std::vector<std::string>& each, const std::string& sum, const std::vector<std::string>& first,
           bool verbose, std::vector<std::string>& notes)
{
    if (verbose || each.size() == 1) {
        notes.insert(notes.end(), each.begin(), each.end());
    } else if (!each.empty()) {
        const std::size_t shown = std::min<std::size_t>(first.size(), 3);
        notes.push_back(fmt::format("{} labels are {}: {}{}; --verbose lists each", each.size(), sum,
                                    fmt::join(first.begin(), first.begin() + static_cast<std::ptrdiff_t>(shown), ", "),
                                    first.size() > shown ? ", ..." : ""));
    }
}

}  // namespace

bool tellsMore(const LabelName& label)
{
    const std::string number = std::to_string(label.value);
    return !label.name.empty() && label.name != number && !sameName(label.name, "label " + number);
}

bool sameName(std::string_view a, std::string_view b)
{
    const auto plain = [](char c) {
        return c == '_' || c == '-' ? ' ' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    };
    return std::ranges::equal(a, b, {}, plain, plain);
}

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
        throw base::error("--default-tissue {}: is not in the tissue table '{}'; it has: {}", options.defaultTissue,
                          table.name, fmt::join(tissuesOf(table), ", "));
    }
    const Mapper mapper(options, file, labels, counts, table, notes);
    std::vector<LabelName> named;
    std::vector<FoundLabel> unknown;
    std::vector<std::string> byName, byDefault, names, values;
    for (const auto& [value, voxels] : counts) {
        FoundLabel found = mapper.tissueOf(value);
        if (found.certain) {
            base::failIf(!options.map.empty() && found.label.tissue.starts_with('?'),
                         "{}: label {} '{}': no tissue '{}': write in the label map which one it is", options.map, value,
                         found.label.name, found.label.tissue);
            if (found.byItsName) {
                byName.push_back(
                    fmt::format("label {} '{}' is taken as {} by its name", value, found.label.name, found.label.tissue));
                names.push_back(fmt::format("'{}' as {}", found.label.name, found.label.tissue));
            }
            named.push_back(std::move(found.label));
        } else if (value != 0 && !options.defaultTissue.empty()) {
            found.label.tissue = options.defaultTissue;
            byDefault.push_back(fmt::format("label {} ({} voxels) is taken as {}", value, voxels, options.defaultTissue));
            values.push_back(fmt::format("{} ({} voxels)", value, voxels));
            named.push_back(std::move(found.label));
        } else if (value != 0) {
            unknown.push_back(std::move(found));
        }
    }
    if (!unknown.empty()) {
        refuseUnknown(file, labels, unknown, counts);
    }
    sumUp(byName, "taken for a tissue by their names", names, options.verbose, notes);
    sumUp(byDefault, fmt::format("taken as {}, the default", options.defaultTissue), values, options.verbose, notes);
    return named;
}

BegunMap writeLabelMap(const MappingOptions& options, const std::filesystem::path& file,
                       const volume::ImportedLabels& labels, const LabelCounts& counts, const volume::TissueTable& table)
{
    std::vector<std::string> notes;
    const Mapper mapper(options, file, labels, counts, table, notes);
    LabelMap map{file.stem().string(), {}, {}};
    BegunMap begun;
    std::string further;
    for (const auto& [value, voxels] : counts) {
        if (const std::int64_t original = labels.originalOf(value); original != value) {
            further += fmt::format("# A label map has values from 0 to 65535. For the label {} give --set {}=TISSUE.\n",
                                   original, original);
            continue;
        }
        FoundLabel found = mapper.tissueOf(value);
        if (value == 0 && found.label.tissue.empty()) {
            continue;
        }
        if (!found.certain) {
            ++begun.open;
            found.label.tissue = found.label.tissue.empty() ? "?" : "? " + found.label.tissue;
        }
        map.labels.push_back(std::move(found.label));
    }
    std::string text =
        fmt::format("# Which tissue each label of {} is: replace every \"?\" by a row of the tissue table.\n",
                    file.filename().string());
    base::writeWhole(options.writeMap, text + further + datasets::labelMapText(map));
    begun.labels = map.labels.size();
    return begun;
}

}  // namespace palpate::prepare
