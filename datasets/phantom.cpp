#include <datasets/phantom.h>

#include <base/error.h>
#include <base/mapped.h>
#include <datasets/phantom_parts.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

namespace palpate::datasets {

namespace {

struct Maker {
    const char* name;
    std::vector<PhantomParameter> (*parameters)();
    PhantomLabels (*make)(const PhantomValues&);
};

constexpr Maker makers[] = {
    {"breast", breastParameters, breastPhantom},
    {"layered", layeredParameters, layeredPhantom},
    {"block", blockParameters, blockPhantom},
};

constexpr double smallestVoxel = 0.1, largestVoxel = 5;  // [mm]

const Maker& makerOf(const std::string& name)
{
    if (const auto maker = std::ranges::find(makers, name, &Maker::name); maker != std::end(makers)) {
        return *maker;
    }
    throw base::error("phantom '{}': there is none; there are {}", name, fmt::join(phantomNames(), ", "));
}

double checked(const std::string& phantom, const PhantomParameter& p, double value)
{
    // The negation also catches what is not a number.
    if (!(value >= p.low && value <= p.high)) {
        const std::string unit = p.unit.empty() ? "" : " " + p.unit;
        throw base::error("phantom '{}': {} = {}{}: must be {:g} to {:g}{}", phantom, p.name, value, unit, p.low, p.high,
                          unit);
    }
    base::failIf(p.whole && value != std::floor(value), "phantom '{}': {} = {}: must be a whole number", phantom, p.name,
                 value);
    return value;
}

PhantomValues checkedValues(const PhantomSpec& spec, const std::vector<PhantomParameter>& parameters)
{
    PhantomValues values;
    values.seed = spec.seed;
    values.memory = spec.memory;
    values.voxel = checked(spec.name, {"voxel", "mm", "", smallestVoxel, largestVoxel, 1, ""}, spec.voxel * 1e3);
    for (const PhantomParameter& p : parameters) {
        if (p.word.empty()) {
            const auto given = spec.numbers.find(p.name);
            values.numbers[p.name] = given == spec.numbers.end() ? p.standard : checked(spec.name, p, given->second);
        } else {
            const auto given = spec.words.find(p.name);
            values.words[p.name] = given == spec.words.end() ? p.word : given->second;
        }
    }
    const auto refuse = [&](const std::string& name) {
        const auto known = base::mapped<std::string>(parameters, &PhantomParameter::name);
        if (const auto p = std::ranges::find(parameters, name, &PhantomParameter::name); p != parameters.end()) {
            throw base::error("phantom '{}': {}: must be {}", spec.name, name,
                              p->word.empty() ? "a number" : fmt::format("a name, as \"{}\" is", p->word));
        }
        throw base::error("phantom '{}': no such parameter '{}'; it takes {}", spec.name, name, fmt::join(known, ", "));
    };
    for (const auto& [name, value] : spec.numbers) {
        if (!values.numbers.contains(name)) {
            refuse(name);
        }
    }
    for (const auto& [name, value] : spec.words) {
        if (!values.words.contains(name)) {
            refuse(name);
        }
    }
    return values;
}

volume::Provenance provenance(const PhantomSpec& spec, const PhantomValues& values)
{
    volume::Provenance out{{"made by", "palpate phantom"},
                           {"phantom", spec.name},
                           {"seed", fmt::format("{}", spec.seed)},
                           {"voxel_mm", fmt::format("{:.12g}", values.voxel)}};
    for (const auto& [name, value] : values.numbers) {
        out.emplace_back(name, fmt::format("{:.12g}", value));
    }
    out.insert(out.end(), values.words.begin(), values.words.end());
    return out;
}

// Every part that was asked for is there: one thinner than a voxel may have the centre of none.
void checkParts(const PhantomSpec& spec, const PhantomValues& values, const PhantomLabels& labels)
{
    std::vector<bool> there(65536, false);
    for (const std::uint16_t v : labels.image.values) {
        there[v] = true;
    }
    for (const PhantomPart& part : labels.parts) {
        base::failIf(!there[part.label],
                     "phantom '{}': {} = {:g} mm: no voxel of {:g} mm has its centre there: choose "
                     "smaller voxels",
                     spec.name, part.parameter, values.number(part.parameter), voxelEdge(labels.image));
    }
}

}  // namespace

std::vector<std::string> phantomNames()
{
    return base::mapped<std::string>(makers, &Maker::name);
}

std::vector<PhantomParameter> phantomParameters(const std::string& name)
{
    std::vector<PhantomParameter> parameters = makerOf(name).parameters();
    parameters.push_back(
        {"voxels_per_side", "", "cubic grid of so many voxels along each side; 0: as voxel says", 0, 1024, 0, "", true});
    return parameters;
}

volume::Tissue makePhantom(const PhantomSpec& spec, const volume::TissueTable& table)
{
    const Maker& maker = makerOf(spec.name);
    const PhantomValues values = checkedValues(spec, phantomParameters(spec.name));
    for (const auto& [name, word] : values.words) {
        base::failIf(!table.find(word), "phantom '{}': {} = \"{}\": the tissue table '{}' has no such tissue", spec.name,
                     name, word, table.name);
    }
    const PhantomLabels labels = maker.make(values);
    checkParts(spec, values, labels);
    return volume::Tissue::fromLabels(labels.image, table, labels.names, provenance(spec, values));
}

}  // namespace palpate::datasets
