#include <datasets/tables.h>

#include <datasets/embedded.h>
#include <datasets/toml_fields.h>

#include <algorithm>
#include <array>
#include <set>
#include <stdexcept>

namespace palpate::datasets {

namespace {

using volume::Role;
using volume::TissueRow;
using volume::TissueTable;

constexpr std::size_t mostTissues = 64;  // what a sample of tissue has room for
constexpr double softest = 0.01;         // [kPa]; anything that is not air resists

// These may be left out: they are there where somebody measured them.
constexpr std::array<Field<TissueRow>, 3> measuredFields{{
    {"stiffening", "", 0, 1000, 1, &TissueRow::stiffening},
    {"stiction_n_per_m", "N/m", 0, 10000, 1, &TissueRow::stictionPerMetre},
    {"friction_ns_m2", "N s/m2", 0, 10000, 1, &TissueRow::frictionDamping},
}};

constexpr std::array<Field<TissueRow>, 12> tissueFields{{
    {"youngs_kpa", "kPa", 0, 2e7, 1e3, &TissueRow::youngsModulus},
    {"poisson", "", 0, 0.4999, 1, &TissueRow::poissonRatio},
    {"density_kg_m3", "kg/m3", 0.1, 20000, 1, &TissueRow::density},
    {"compress", "", 0.01, 1, 1, &TissueRow::compress},
    {"stretch", "", 1, 10, 1, &TissueRow::stretch},
    {"shear", "", 0, 10, 1, &TissueRow::shear},
    {"puncture_n", "N", 0, 1000, 1, &TissueRow::punctureForce},
    {"cutting_n", "N", 0, 1000, 1, &TissueRow::cuttingForce},
    {"friction_n_per_m", "N/m", 0, 10000, 1, &TissueRow::frictionPerMetre},
    {"fixed", "", 0, 0, 1, &TissueRow::fixed},
    {"opacity", "", 0, 1, 1, &TissueRow::opacity},
    {"source", "", 0, 0, 1, &TissueRow::source},
}};

Role readRole(Section& section)
{
    const std::optional<std::string> text = section.word("role");
    if (!text) {
        section.missing("role", "plain, skin, tumour, vital, bone or air");
    }
    const std::optional<Role> role = volume::roleNamed(*text);
    if (!role) {
        section.refuse("role", "must be plain, skin, tumour, vital, bone or air");
    }
    return *role;
}

// "#rrggbb"
glm::vec3 readColour(Section& section)
{
    const std::string text = section.word("colour").value_or("");
    constexpr std::string_view digits = "0123456789abcdefABCDEF";
    if (text.size() != 7 || text[0] != '#' || text.find_first_not_of(digits, 1) != std::string::npos) {
        section.refuse("colour", "must be \"#rrggbb\"");
    }
    glm::vec3 colour(0.0F);
    for (int c = 0; c < 3; ++c) {
        const std::string pair = text.substr(1 + 2 * static_cast<std::size_t>(c), 2);
        colour[c] = static_cast<float>(std::stoi(pair, nullptr, 16)) / 255.0F;
    }
    return colour;
}

TissueRow readTissue(Section& section)
{
    TissueRow row;
    const std::optional<std::string> name = section.word("name");
    if (!name) {
        section.missing("name", "");
    }
    row.name = *name;
    section.setTitle(fmt::format("tissue '{}':", row.name));
    row.role = readRole(section);
    row.colour = readColour(section);
    readFields<TissueRow>(section, tissueFields, row, Need::all);
    readFields<TissueRow>(section, measuredFields, row, Need::some);
    section.finish();
    if (row.role != Role::air && row.youngsModulus < softest * 1e3) {
        section.refuse("youngs_kpa", fmt::format("must be {:g} kPa or more; only air has no stiffness", softest), "kPa");
    }
    if (row.cuttingForce > row.punctureForce) {
        section.refuse("cutting_n", "must not be over puncture_n: the force drops after the puncture", "N");
    }
    return row;
}

TissueTable readTissues(std::string_view text, const std::string& file)
{
    const toml::table root = parseToml(text, file);
    Section top(root, file, "");
    TissueTable table;
    table.name = top.word("name").value_or(std::filesystem::path(file).stem().string());
    for (Section& section : top.sections("tissue")) {
        TissueRow row = readTissue(section);
        if (table.find(row.name)) {
            section.refuse("name", "is there twice");
        }
        if (table.rows.empty() != (row.name == "air") || (row.name == "air") != (row.role == Role::air)) {
            section.refuse("role", "the first tissue, and no other, must be \"air\" of role air");
        }
        table.rows.push_back(std::move(row));
        if (table.rows.size() > mostTissues) {
            section.refuse("name", fmt::format("over {} tissues", mostTissues));
        }
    }
    top.finish();
    if (table.rows.empty()) {
        throw std::runtime_error(file + ": no [[tissue]] in it: see `palpate phantom --help` for the built-in table");
    }
    return table;
}

LabelMap readLabelMap(std::string_view text, const std::string& file)
{
    const toml::table root = parseToml(text, file);
    Section top(root, file, "");
    LabelMap map;
    map.name = top.word("name").value_or(std::filesystem::path(file).stem().string());
    std::set<std::uint16_t> seen;
    for (Section& section : top.sections("labels")) {
        const auto value = section.integer("value", "", 0, 65535);
        const auto name = section.word("name");
        const auto tissue = section.word("tissue");
        if (!value || !name || !tissue) {
            section.missing(!value ? "value" : !name ? "name" : "tissue", "each label has value, name and tissue");
        }
        section.finish();
        if (!seen.insert(static_cast<std::uint16_t>(*value)).second) {
            section.refuse("value", "is there twice");
        }
        map.labels.push_back({static_cast<std::uint16_t>(*value), *name, *tissue});
    }
    top.finish();
    if (map.labels.empty()) {
        throw std::runtime_error(file +
                                 ": no labels in it: labels = [ { value = 1, name = \"liver\", tissue = \"liver\" } ]");
    }
    return map;
}

}  // namespace

volume::TissueTable defaultTissues()
{
    return readTissues(embeddedFile("tables/tissues.toml"), "built-in tissues.toml");
}

volume::TissueTable loadTissues(const std::filesystem::path& file)
{
    return readTissues(readText(file), file.string());
}

std::vector<std::string> labelMapNames()
{
    return {"victre", "totalsegmentator"};
}

LabelMap labelMap(const std::string& nameOrFile)
{
    const std::vector<std::string> names = labelMapNames();
    if (std::find(names.begin(), names.end(), nameOrFile) != names.end()) {
        const std::string file = nameOrFile + ".toml";
        return readLabelMap(embeddedFile("tables/" + file), "built-in " + file);
    }
    std::error_code error;
    if (!std::filesystem::exists(nameOrFile, error)) {
        throw std::runtime_error(
            fmt::format("{}: neither a file nor a built-in label map ({})", nameOrFile, fmt::join(names, ", ")));
    }
    return readLabelMap(readText(nameOrFile), nameOrFile);
}

}  // namespace palpate::datasets
