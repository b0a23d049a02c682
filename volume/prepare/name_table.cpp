#include <volume/prepare/name_table.h>

#include <base/error.h>
#include <base/inputs.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <optional>
#include <regex>
#include <sstream>

namespace palpate::prepare {

namespace {

using nlohmann::json;

constexpr std::size_t maxRowsListed = 8;   // labels in a message
constexpr std::size_t longestLine = 1000;  // std::regex needs a frame of the stack for each character

std::string textOf(const std::filesystem::path& file)
{
    base::checkTable(file, "a table of names");
    std::optional<std::string> text = base::contentOf(file);
    base::failIf(!text, "{}: cannot be read: check its permissions", file.native());
    return *std::move(text);
}

std::uint8_t byteOf(const std::string& text)
{
    return static_cast<std::uint8_t>(std::min(255L, std::stol(text)));
}

// "VALUE NAME R G B A" or "VALUE R G B A VISIBLE MESH "NAME"".
void readLines(const std::string& text, NameTable& table)
{
    static const std::regex colours(R"(\s*(-?\d{1,18})\s+(\S|\S.*\S)\s+(\d{1,6})\s+(\d{1,6})\s+(\d{1,6})\s+(\d{1,6})\s*)");
    static const std::regex snap(
        R"(\s*(\d{1,18})\s+(\d{1,6})\s+(\d{1,6})\s+(\d{1,6})\s+([\d.]{1,20})\s+[01]\s+[01]\s+"(.*)\"\s*)");
    std::istringstream in(text);
    std::string line;
    for (std::size_t number = 1; std::getline(in, line); ++number) {
        const auto first = line.find_first_not_of(" \t\r");
        if (first == std::string::npos || line[first] == '#') {
            continue;
        }
        std::smatch m;
        const bool isShort = line.size() <= longestLine;
        const bool snapped = isShort && std::regex_match(line, m, snap);
        base::failIf(
            !snapped && !(isShort && std::regex_match(line, m, colours)),
            "{}:{}: neither VALUE NAME R G B A of 3D Slicer and FreeSurfer nor VALUE R G B A VISIBLE MESH \"NAME\" of "
            "ITK-SNAP nor a dataset.json: name the table that belongs to the labels",
            table.file.native(), number);
        const std::size_t red = snapped ? 2 : 3;
        table.kind = snapped ? "ITK-SNAP label description" : "colour table";
        table.entries.push_back(
            {std::stoll(m[1]), m[snapped ? 6 : 2], std::array{byteOf(m[red]), byteOf(m[red + 1]), byteOf(m[red + 2])}});
    }
}

bool isWhole(const std::string& text)
{
    return !text.empty() && text.size() <= 9 &&
           std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
}

// {"1": "liver"} of the Decathlon and {"liver": 1} of nnU-Net, where {"whole": [1, 2]} is a region.
void readDataset(const json& root, NameTable& table)
{
    table.kind = "dataset.json";
    base::failIf(!root.is_object() || !root.contains("labels") || !root.at("labels").is_object(),
                 "{}: is JSON without \"labels\": name the dataset.json of the data set", table.file.native());
    for (const auto& [key, value] : root.at("labels").items()) {
        const bool single = value.is_array() && value.size() == 1 && value[0].is_number_integer();
        if (value.is_string() && isWhole(key)) {
            table.entries.push_back({std::stoll(key), value.get<std::string>()});
        } else if (value.is_number_integer() || single) {
            table.entries.push_back({(single ? value[0] : value).get<std::int64_t>(), key});
        } else if (value.is_array()) {
            table.regions.push_back(key);
        } else {
            throw base::error("{}: labels: \"{}\" is neither {{\"1\": \"liver\"}} nor {{\"liver\": 1}}",
                              table.file.native(), key);
        }
    }
}

json jsonOf(const std::filesystem::path& file, const std::string& text)
{
    try {
        return json::parse(text);
    } catch (const json::exception& e) {
        throw base::error("{}: is not JSON ({}): get it again", file.native(), e.what());
    }
}

// Whether a dataset.json that lists its cases has this one; one that lists none has all.
bool listsCase(const json& root, const std::filesystem::path& labels)
{
    bool listed = false;
    bool any = false;
    for (const char* list : {"training", "validation", "test"}) {
        if (!root.is_object() || !root.contains(list) || !root.at(list).is_array()) {
            continue;
        }
        for (const json& entry : root.at(list)) {
            const json* label = entry.is_object() && entry.contains("label") ? &entry.at("label") : nullptr;
            if (label != nullptr && label->is_string()) {
                any = true;
                listed = listed || std::filesystem::path(label->get<std::string>()).filename() == labels.filename();
            }
        }
    }
    return listed || !any;
}

std::string joined(std::vector<std::string> list)
{
    const std::size_t all = list.size();
    list.resize(std::min(all, maxRowsListed));
    return fmt::format("{}{}", fmt::join(list, "; "),
                       all > maxRowsListed ? fmt::format("; and {} more", all - maxRowsListed) : "");
}

// The entry of a value, checked for being the only one.
const NameTable::Entry* entryOf(const NameTable& table, std::int64_t value)
{
    const NameTable::Entry* found = nullptr;
    for (const NameTable::Entry& e : table.entries) {
        if (e.value != value) {
            continue;
        }
        if (found != nullptr && !sameName(found->name, e.name)) {
            throw base::error("{}: calls label {} both '{}' and '{}': remove one", table.file.native(), value, found->name,
                              e.name);
        }
        found = &e;
    }
    return found;
}

void apply(const NameTable& table, const std::filesystem::path& file, const LabelCounts& counts,
           volume::ImportedLabels& labels)
{
    std::vector<std::string> contradictions, missing;
    std::size_t given = 0;
    for (const auto& [value, voxels] : counts) {
        const std::int64_t original = labels.originalOf(value);
        const NameTable::Entry* entry = value == 0 ? nullptr : entryOf(table, original);
        if (entry == nullptr) {
            if (value != 0) {
                missing.push_back(std::to_string(original));
            }
            continue;
        }
        auto own =
            std::find_if(labels.names.begin(), labels.names.end(), [v = value](const auto& n) { return n.value == v; });
        if (own == labels.names.end()) {
            own = labels.names.insert(own, volume::LabelName{value, "", ""});
        } else if (tellsMore(*own) && !sameName(own->name, entry->name)) {
            contradictions.push_back(
                fmt::format("{} is '{}' in the file and '{}' in the table", value, own->name, entry->name));
            continue;
        }
        own->name = entry->name;
        own->colour = own->colour ? own->colour : entry->colour;
        ++given;
    }
    base::failIf(!contradictions.empty(),
                 "{}: the names in {} contradict those in the file: {}: leave the table out, or name the right one",
                 file.native(), table.file.native(), joined(contradictions));
    base::failIf(given == 0, "{}: names none of the labels of {} ({}): is it the table of another file?",
                 table.file.native(), file.filename().string(), joined(missing));
    if (!missing.empty()) {
        labels.warnings.push_back(fmt::format("{} has no name for {} of the labels: {}", table.file.filename().string(),
                                              missing.size(), joined(missing)));
    }
    if (!table.regions.empty()) {
        labels.warnings.push_back(fmt::format("{}: regions of several labels name none of them: {}",
                                              table.file.filename().string(), joined(table.regions)));
    }
}

}  // namespace

NameTable readNameTable(const std::filesystem::path& file)
{
    NameTable table{file, "", {}, {}};
    const std::string text = textOf(file);
    const auto first = text.find_first_not_of(" \t\r\n");
    if (first != std::string::npos && text[first] == '{') {
        readDataset(jsonOf(file, text), table);
    } else {
        readLines(text, table);
    }
    base::failIf(table.entries.empty(), "{}: holds no names of labels: name the table that belongs to the labels",
                 file.native());
    return table;
}

std::optional<std::filesystem::path> datasetOf(const std::filesystem::path& labels, std::vector<std::string>& notes)
{
    const std::filesystem::path folder = std::filesystem::absolute(labels).parent_path();
    const bool inSet = folder.filename().string().rfind("labels", 0) == 0;
    std::error_code error;
    const bool predicted = std::filesystem::exists(folder / "plans.json", error);
    const std::filesystem::path file = (inSet ? folder.parent_path() : folder) / "dataset.json";
    if ((!inSet && !predicted) || !base::whyNoFile(file).empty()) {
        return std::nullopt;
    }
    if (!listsCase(jsonOf(file, textOf(file)), labels)) {
        notes.push_back(fmt::format("{} is not used: it does not list {}", file.string(), labels.filename().string()));
        return std::nullopt;
    }
    return file;
}

void addNames(const MappingOptions& options, const std::filesystem::path& file, const LabelCounts& counts,
              volume::ImportedLabels& labels)
{
    if (!options.names.empty()) {
        apply(readNameTable(options.names), file, counts, labels);
        return;
    }
    const bool named = std::any_of(labels.names.begin(), labels.names.end(), [](const auto& n) { return tellsMore(n); });
    if (const auto found = named ? std::nullopt : datasetOf(file, labels.warnings)) {
        apply(readNameTable(*found), file, counts, labels);
        labels.warnings.push_back(fmt::format("names of labels are those of {}", found->string()));
    }
}

}  // namespace palpate::prepare
