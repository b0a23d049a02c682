#include <datasets/label_map.h>

#include <base/error.h>
#include <base/mapped.h>
#include <datasets/embedded.h>
#include <datasets/toml_fields.h>

#include <base/inputs.h>
#include <base/nearest.h>

#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <regex>
#include <set>

namespace palpate::datasets {

namespace {

constexpr double farthestValue = 1e6;  // of an image
constexpr double maxFactor = 1e3;      // on a modulus

// One map: the top of a file, or one [[map]] of several.
LabelMap readMap(Section& top, const std::string& fallbackName)
{
    LabelMap map;
    map.name = top.word("name").value_or(fallbackName);
    map.source = top.word("source").value_or("");
    map.general = top.flag("general").value_or(true);
    std::set<std::uint16_t> seen;
    for (Section& section : top.sections("labels")) {
        const auto value = section.integer("value", "", 0, 65535);
        const auto name = section.word("name");
        const auto tissue = section.word("tissue");
        section.missingIf(!tissue || (!value && !name), tissue ? "value" : "tissue",
                          "each label has a tissue, and a value or a name or both");
        section.finish();
        if (!value) {
            map.segments.emplace_back(*name, *tissue);
        } else if (seen.insert(static_cast<std::uint16_t>(*value)).second) {
            map.labels.push_back({static_cast<std::uint16_t>(*value), name.value_or(""), *tissue});
        } else {
            section.refuse("value", "is there twice");
        }
    }
    top.finish();
    return map;
}

LabelMap readLabelMap(std::string_view text, const std::string& file)
{
    const toml::table root = parseToml(text, file);
    Section top(root, file, "");
    LabelMap map = readMap(top, std::filesystem::path(file).stem().string());
    base::failIf(map.labels.empty() && map.segments.empty(),
                 "{}: no labels in it: labels = [ {{ value = 1, name = \"liver\", tissue = \"liver\" }} ]", file);
    return map;
}

std::vector<LabelMap> readBuiltIn()
{
    std::vector<LabelMap> maps;
    for (const std::string name : {"victre", "totalsegmentator", "freesurfer", "spl-abdomen", "spl-brain"}) {
        maps.push_back(readLabelMap(embeddedFile("tables/" + name + ".toml"), "built-in " + name + ".toml"));
    }
    for (const std::string name : {"challenges", "totalsegmentator-tasks"}) {
        const std::string file = "built-in " + name + ".toml";
        const toml::table root = parseToml(embeddedFile("tables/" + name + ".toml"), file);
        Section top(root, file, "");
        for (Section& section : top.sections("map")) {
            maps.push_back(readMap(section, name));
        }
        top.finish();
    }
    return maps;
}

// Text of a built-in table, or of the file that is called so.
std::string textOf(const std::string& nameOrFile, const std::vector<std::string>& names, std::string_view what,
                   std::string& origin)
{
    if (std::find(names.begin(), names.end(), nameOrFile) != names.end()) {
        origin = "built-in " + nameOrFile + ".toml";
        return std::string(embeddedFile("tables/" + nameOrFile + ".toml"));
    }
    std::error_code error;
    base::failIf(!std::filesystem::exists(nameOrFile, error), "{}: neither a file nor a built-in {} ({})", nameOrFile, what,
                 fmt::join(names, ", "));
    origin = nameOrFile;
    return readText(nameOrFile);
}

// Where `phrase` begins in `words`, or nothing.
bool holds(const std::vector<std::string>& words, const std::vector<std::string>& phrase)
{
    return !phrase.empty() && std::search(words.begin(), words.end(), phrase.begin(), phrase.end()) != words.end();
}

// points = [[value, factor], ..]
std::vector<std::pair<double, double>> pointsOf(Section& top)
{
    constexpr const char* form = "must be [[value, factor], ..] with growing values and factors from 0.001 to 1000";
    std::vector<std::pair<double, double>> points;
    const toml::node* node = top.node("points");
    const toml::array* list = node != nullptr ? node->as_array() : nullptr;
    for (std::size_t i = 0; list != nullptr && i < list->size(); ++i) {
        const toml::array* pair = list->get(i)->as_array();
        const auto value = pair != nullptr && pair->size() == 2 ? pair->get(0)->value<double>() : std::nullopt;
        const auto factor = pair != nullptr && pair->size() == 2 ? pair->get(1)->value<double>() : std::nullopt;
        const bool grows = value && std::abs(*value) <= farthestValue && (points.empty() || *value > points.back().first);
        top.refuseIf(!grows || !factor || !(*factor >= 1 / maxFactor && *factor <= maxFactor), "points", form);
        points.emplace_back(*value, *factor);
    }
    top.refuseIf(points.empty() && node != nullptr, "points", form);
    top.missingIf(points.empty(), "points", form);
    return points;
}

// Roman numerals, also with a letter behind: lobules of a cerebellum, segments of a liver, nerves of a head.
bool isNumeral(std::string_view name)
{
    static const std::regex numeral(R"((left|right)?[ _]*[IVX]+[AB]?([ _][a-z])?)");
    return std::regex_match(name.begin(), name.end(), numeral);
}

// Whether a word is the initials of those before it.
bool isInitials(const std::vector<std::string>& words, const std::string& word)
{
    return word.size() > 1 && word.size() <= words.size() &&
           std::equal(word.begin(), word.end(), words.end() - static_cast<std::ptrdiff_t>(word.size()),
                      [](char initial, const std::string& before) { return initial == before.front(); });
}

}  // namespace

const std::vector<LabelMap>& labelMaps()
{
    static const std::vector<LabelMap> maps = readBuiltIn();
    return maps;
}

std::vector<std::string> labelMapNames()
{
    return base::mapped<std::string>(labelMaps(), &LabelMap::name);
}

LabelMap labelMap(const std::string& nameOrFile)
{
    const std::string name = nameOrFile == "destrieux" ? "freesurfer" : nameOrFile;
    if (const auto known = std::ranges::find(labelMaps(), name, &LabelMap::name); known != labelMaps().end()) {
        return *known;
    }
    if (const std::string why = base::whyNoFile(nameOrFile); !why.empty()) {
        const std::vector<std::string> names = labelMapNames();
        const std::string near = base::nearest(nameOrFile, names);
        throw base::error(
            "{}: neither a file ({}) nor one of the {} built-in label maps{}; 'palpate import --list-maps' lists "
            "them",
            nameOrFile, why, names.size(), near.empty() ? "" : fmt::format(", is it {}?", near));
    }
    return readLabelMap(readText(nameOrFile), nameOrFile);
}

std::string labelMapText(const LabelMap& map)
{
    std::string out = fmt::format("name = {}\nlabels = [\n", tomlString(map.name));
    for (const volume::LabelName& label : map.labels) {
        out += fmt::format("  {{ value = {}, name = {}, tissue = {} }},\n", label.value, tomlString(label.name),
                           tomlString(label.tissue));
    }
    for (const auto& [name, tissue] : map.segments) {
        out += fmt::format("  {{ name = {}, tissue = {} }},\n", tomlString(name), tomlString(tissue));
    }
    return out + "]\n";
}

StructureNames::StructureNames()
{
    const std::string file = "built-in names.toml";
    const toml::table root = parseToml(embeddedFile("tables/names.toml"), file);
    for (const toml::node& word : *root["ignored"].as_array()) {
        ignored_.push_back(*word.value<std::string>());
    }
    for (const toml::node& entry : *root["names"].as_array()) {
        const toml::table& table = *entry.as_table();
        const std::string tissue = *table["tissue"].value<std::string>();
        phrases_.emplace_back(wordsOf(tissue), tissue);
        for (const toml::node& phrase : *table["words"].as_array()) {
            phrases_.emplace_back(wordsOf(*phrase.value<std::string>()), tissue);
        }
    }
    for (const toml::node& phrase : *root["ambiguous"].as_array()) {
        ambiguous_.push_back(wordsOf(*phrase.value<std::string>()));
    }
    for (const LabelMap& map : labelMaps()) {
        for (const volume::LabelName& label : map.labels) {
            if (map.general && !isNumeral(label.name)) {
                labels_.emplace_back(wordsOf(label.name), label.tissue);
            }
        }
    }
}

// Words in lower case without what says nothing about the tissue; plurals in -s as singulars.
StructureNames::Words StructureNames::wordsOf(std::string_view name) const
{
    Words words(1);
    for (const char c : name) {
        const auto letter = static_cast<unsigned char>(c);
        if (std::isalpha(letter) != 0 || letter >= 0x80) {
            words.back() += static_cast<char>(std::tolower(letter));
        } else if (!words.back().empty()) {
            words.emplace_back();
        }
    }
    words.erase(std::remove(words.begin(), words.end(), ""), words.end());
    Words whole, out;
    for (std::string& word : words) {
        if (isInitials(whole, word)) {
            continue;
        }
        whole.push_back(word);
        const bool says = std::find(ignored_.begin(), ignored_.end(), word) == ignored_.end();
        if (says) {
            if (word.size() > 3 && word.ends_with('s') && !word.ends_with("ss") && !word.ends_with("us") &&
                !word.ends_with("is") && !word.ends_with("as")) {
                word.pop_back();
            }
            out.push_back(std::move(word));
        }
    }
    return out;
}

std::optional<std::string> StructureNames::tissueOf(std::string_view name) const
{
    const Words words = wordsOf(name);
    if (std::find(ambiguous_.begin(), ambiguous_.end(), words) != ambiguous_.end()) {
        return std::nullopt;
    }
    for (const auto* known : {&phrases_, &labels_}) {
        const auto found = std::ranges::find(*known, words, [](const auto& entry) { return entry.first; });
        if (!words.empty() && found != known->end()) {
            return found->second;
        }
    }
    return std::nullopt;
}

std::optional<std::string> StructureNames::suggestion(std::string_view name) const
{
    const Words words = wordsOf(name);
    const std::pair<Words, std::string>* best = nullptr;
    for (const auto& known : phrases_) {
        if (holds(words, known.first) && (best == nullptr || known.first.size() > best->first.size())) {
            best = &known;
        }
    }
    return best != nullptr ? std::optional(best->second) : std::nullopt;
}

volume::StiffnessMap stiffnessMap(const std::string& nameOrFile, const std::string& unit, const volume::TissueTable& table)
{
    std::string file;
    const std::string text = textOf(nameOrFile, {"hu"}, "stiffness map", file);
    const toml::table root = parseToml(text, file);
    Section top(root, file, "");
    const auto wanted = top.word("unit");
    if (wanted && *wanted != unit) {
        const bool perhaps = unit.empty() && *wanted == "HU";
        top.refuse("unit",
                   perhaps ? "the image does not say its unit: add --image-unit HU if it is CT"
                           : fmt::format("the image is in {}: give a map for that", unit.empty() ? "no known unit" : unit));
    }
    volume::StiffnessMap map{pointsOf(top), {}, {}};
    if (const toml::node* node = top.node("tissues")) {
        const toml::array* list = node->as_array();
        for (std::size_t i = 0; list != nullptr && i < list->size(); ++i) {
            map.tissues.push_back(list->get(i)->value<std::string>().value_or(""));
        }
        top.refuseIf(map.tissues.empty(), "tissues", "must be a list of tissues: [\"fat\", \"gland\"]");
    }
    for (const std::string& tissue : map.tissues) {
        top.refuseIf(!table.find(tissue), "tissues",
                     fmt::format("'{}' is not in the tissue table '{}'", tissue, table.name));
    }
    top.finish();
    return map;
}

}  // namespace palpate::datasets
