#include <datasets/tables.h>

#include <base/error.h>
#include <base/mapped.h>
#include <datasets/embedded.h>
#include <datasets/scene_text.h>
#include <datasets/toml_fields.h>
#include <volume/law.h>

#include <algorithm>
#include <array>
#include <stdexcept>

namespace palpate::datasets {

namespace {

using volume::Acoustics;
using volume::Role;
using volume::TissueRow;
using volume::TissueTable;

constexpr std::size_t maxTissues = 64;  // what a sample of tissue has room for
constexpr double softest = 0.01;        // [kPa]; anything that is not air resists
constexpr double maxRelaxing = 0.95;    // of the stress right after a step

// These may be left out: they are there where somebody measured them.
constexpr std::array<Field<TissueRow>, 9> measuredFields{{
    {"stiffening", "", volume::minStiffening, volume::maxStiffening, 1, &TissueRow::stiffening},
    {"stiction_n_per_m", "N/m", 0, 10000, 1, &TissueRow::stictionPerMetre},
    {"friction_ns_m2", "N s/m2", 0, 10000, 1, &TissueRow::frictionDamping},
    {"relaxing_fast", "", 0, 0.95, 1, &TissueRow::relaxingFast},
    {"relaxing_slow", "", 0, 0.95, 1, &TissueRow::relaxingSlow},
    {"relaxation_source", "", 0, 0, 1, &TissueRow::relaxationSource},
    {"wall_spacing_mm", "mm", 0.5, 1000, 1e-3, &TissueRow::wallSpacing},
    {"wall_n", "N", 0.001, 100, 1, &TissueRow::wallForce},
    {"wall_source", "", 0, 0, 1, &TissueRow::wallSource},
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

// For the ultrasound picture: all of them, or none.
constexpr std::array<Field<Acoustics>, 6> acousticFields{{
    {"sound_speed_m_s", "m/s", 100, 10000, 1, &Acoustics::soundSpeed},
    {"attenuation_db_cm", "dB/cm", 0, 1000, 1, &Acoustics::attenuation},
    {"attenuation_power", "", 0, 3, 1, &Acoustics::attenuationPower},
    {"echo_db", "dB", -100, 60, 1, &Acoustics::echo},
    {"echo_variation_db", "dB", 0, 30, 1, &Acoustics::echoVariation},
    {"acoustic_source", "", 0, 0, 1, &Acoustics::source},
}};
constexpr std::string_view echoPatternKey = "echo_pattern";

void readAcoustics(Section& section, Acoustics& acoustics)
{
    const bool any = std::ranges::any_of(acousticFields, [&](const auto& f) { return section.has(f.key); });
    if (!any && !section.has(echoPatternKey)) {
        return;
    }
    readFields<Acoustics>(section, acousticFields, acoustics, Need::all);
    if (const auto pattern = section.choice(echoPatternKey, volume::echoPatterns)) {
        acoustics.pattern = static_cast<volume::EchoPattern>(*pattern);
    }
}

Role readRole(Section& section)
{
    const std::optional<std::string> text = section.word("role");
    section.missingIf(!text, "role", "plain, skin, tumour, vital, bone or air");
    const std::optional<Role> role = volume::roleNamed(*text);
    section.refuseIf(!role, "role", "must be plain, skin, tumour, vital, bone or air");
    return *role;
}

// "#rrggbb"
glm::vec3 readColour(Section& section)
{
    const std::string text = section.word("colour").value_or("");
    constexpr std::string_view digits = "0123456789abcdefABCDEF";
    section.refuseIf(text.size() != 7 || text[0] != '#' || text.find_first_not_of(digits, 1) != std::string::npos, "colour",
                     "must be \"#rrggbb\"");
    glm::vec3 colour(0.0F);
    for (int c = 0; c < 3; ++c) {
        const std::string pair = text.substr(1 + 2 * static_cast<std::size_t>(c), 2);
        colour[c] = static_cast<float>(std::stoi(pair, nullptr, 16)) / 255.0F;
    }
    return colour;
}

// Empty, or the key that does not go with the others and why.
std::pair<std::string_view, std::string> misfit(const TissueRow& row)
{
    if (row.role != Role::air && row.youngsModulus < softest * 1e3) {
        return {"youngs_kpa",
                fmt::format("must be {:g} to {:g} kPa; only air has no stiffness", softest, tissueFields[0].high)};
    }
    if (row.relaxingFast + row.relaxingSlow > maxRelaxing) {
        return {"relaxing_slow", fmt::format("must not be over {:g} together with relaxing_fast: a solid keeps some of its "
                                             "stress",
                                             maxRelaxing)};
    }
    if ((row.wallSpacing > 0.0) != (row.wallForce > 0.0)) {
        return {row.wallSpacing > 0.0 ? "wall_n" : "wall_spacing_mm", "is missing: inner walls have both"};
    }
    if (row.cuttingForce > row.punctureForce) {
        return {"cutting_n", "must not be over puncture_n: the force drops after the puncture"};
    }
    return {};
}

TissueRow readTissue(Section& section)
{
    TissueRow row;
    const std::optional<std::string> name = section.word("name");
    section.missingIf(!name, "name", "");
    row.name = *name;
    section.setTitle(fmt::format("tissue '{}':", row.name));
    row.role = readRole(section);
    row.colour = readColour(section);
    readFields<TissueRow>(section, tissueFields, row, Need::all);
    readFields<TissueRow>(section, measuredFields, row, Need::some);
    readAcoustics(section, row.acoustics);
    section.finish();
    section.missingIf(row.wallSpacing > 0.0 && row.wallForce <= 0.0, "wall_n", "what the walls hold");
    section.missingIf(row.wallForce > 0.0 && row.wallSpacing <= 0.0, "wall_spacing_mm",
                      "how far the walls are from each other");
    section.missingIf(row.wallSpacing > 0.0 && row.wallSource.empty(), "wall_source",
                      "where wall_spacing_mm and wall_n come from");
    if (const auto [key, why] = misfit(row); !key.empty()) {
        section.refuse(key, why, key == "cutting_n" ? "N" : key == "youngs_kpa" ? "kPa" : "");
    }
    section.missingIf(row.relaxation().any() && row.relaxationSource.empty(), "relaxation_source",
                      "where relaxing_fast and relaxing_slow come from");
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
        section.refuseIf(table.find(row.name).has_value(), "name", "is there twice");
        section.refuseIf(table.rows.empty() != (row.name == "air") || (row.name == "air") != (row.role == Role::air),
                         "role", "the first tissue, and no other, must be \"air\" of role air");
        table.rows.push_back(std::move(row));
        section.refuseIf(table.rows.size() > maxTissues, "name", fmt::format("over {} tissues", maxTissues));
    }
    top.finish();
    base::failIf(table.rows.empty(), "{}: no [[tissue]] in it: see `palpate phantom --help` for the built-in table", file);
    return table;
}

}  // namespace

// Applies `use` to every number that tissue tables give a row.
template <class Use>
void forNumbers(Use use)
{
    for (const std::span<const Field<TissueRow>> fields :
         {std::span<const Field<TissueRow>>(tissueFields), std::span<const Field<TissueRow>>(measuredFields)}) {
        for (const Field<TissueRow>& f : fields) {
            if (const auto* const member = std::get_if<double TissueRow::*>(&f.member)) {
                use(f, *member);
            }
        }
    }
}

// The same for what the table says of ultrasound.
template <class Use>
void forAcoustics(Use use)
{
    for (const Field<Acoustics>& f : acousticFields) {
        if (const auto* const member = std::get_if<double Acoustics::*>(&f.member)) {
            use(f, *member);
        }
    }
}

std::vector<TissueChange> readTissueChanges(Section& top)
{
    std::vector<TissueChange> changes;
    std::optional<Section> all = top.section("tissue");
    if (!all) {
        return changes;
    }
    for (const std::string& name : all->keys()) {
        Section section = *all->section(name);
        TissueChange change{name, {}, section.place(), {}};
        const auto read = [&](const auto& f, auto) {
            if (const auto value = section.number(f.key, f.unit, f.low, f.high)) {
                change.values.emplace_back(f.key, *value);
                change.places.push_back(section.place(f.key));
            }
        };
        forNumbers(read);
        forAcoustics(read);
        section.finish();
        changes.push_back(std::move(change));
    }
    return changes;
}

std::string tissueChangesText(std::span<const TissueChange> changes)
{
    std::string out;
    for (const TissueChange& change : changes) {
        out += fmt::format("\n[tissue.{}]\n", tomlString(change.tissue));
        for (const auto& [key, value] : change.values) {
            out += fmt::format("{} = {}\n", key, value);
        }
    }
    return out;
}

// What a table without figures for ultrasound lacks comes from the built-in one first, so that one of them can be changed.
void changeAcoustics(TissueRow& row, const TissueChange& change)
{
    forAcoustics([&](const Field<Acoustics>& f, double Acoustics::*member) {
        for (const auto& [key, value] : change.values) {
            if (key == f.key) {
                row.acoustics = acousticsOf(row);
                row.acoustics.*member = value * f.si;
            }
        }
    });
}

// "scene.toml:12: [tissue.fat] youngs_kpa = 0 kPa: "; without a value where the scene does not say that key.
std::string placeOf(const TissueChange& change, std::string_view key)
{
    std::string place = change.place, value;
    for (std::size_t i = 0; i < change.values.size(); ++i) {
        if (change.values[i].first == key) {
            place = i < change.places.size() ? change.places[i] : place;
            value = fmt::format(" = {}", change.values[i].second);
        }
    }
    forNumbers([&](const Field<TissueRow>& f, double TissueRow::*) {
        if (f.key == key && !value.empty() && !std::string_view(f.unit).empty()) {
            value += fmt::format(" {}", f.unit);
        }
    });
    return fmt::format("{}{}[tissue.{}] {}{}: ", place, place.empty() ? "" : ": ", change.tissue, key, value);
}

TissueTable withChanges(TissueTable table, std::span<const TissueChange> changes)
{
    for (const TissueChange& change : changes) {
        const auto index = table.find(change.tissue);
        if (!index || *index == 0) {
            const auto names = base::mapped<std::string>(std::span(table.rows).subspan(1), &TissueRow::name);
            throw base::error("{}{}[tissue.{}]: is not in the volume's tissue table; it has: {}", change.place,
                              change.place.empty() ? "" : ": ", change.tissue, fmt::join(names, ", "));
        }
        TissueRow& row = table.rows[*index];
        forNumbers([&](const Field<TissueRow>& f, double TissueRow::*member) {
            for (const auto& [key, value] : change.values) {
                if (key == f.key) {
                    row.*member = value * f.si;
                }
            }
        });
        changeAcoustics(row, change);
        if (const auto [key, why] = misfit(row); !key.empty()) {
            throw std::runtime_error(placeOf(change, key) + why);
        }
    }
    return table;
}

volume::Acoustics acousticsOf(const volume::TissueRow& row)
{
    if (row.acoustics.given()) {
        return row.acoustics;
    }
    static const volume::TissueTable known = defaultTissues();
    const bool hasOwn = row.role == Role::air || row.role == Role::skin || row.role == Role::bone;
    const auto same = known.find(row.name);
    return known.rows[same ? *same : known.find(hasOwn ? volume::name(row.role) : "soft_tissue").value()].acoustics;
}

volume::TissueTable defaultTissues()
{
    return readTissues(embeddedFile("tables/tissues.toml"), "built-in tissues.toml");
}

volume::TissueTable loadTissues(const std::filesystem::path& file)
{
    return readTissues(readText(file), file.string());
}

}  // namespace palpate::datasets
