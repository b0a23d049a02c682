#include <apps/command.h>
#include <apps/volume_report.h>
#include <datasets/tables.h>
#include <volume/fnv.h>
#include <volume/import.h>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <ctime>
#include <map>
#include <memory>
#include <stdexcept>

namespace palpate::apps {

namespace {

using volume::LabelName;

struct ImportOptions {
    std::filesystem::path labels, output, tissues, json;
    std::string map, defaultTissue;
};

using Counts = std::map<std::uint16_t, std::uint64_t>;  // label value, voxels

Counts countLabels(const volume::LabelImage& image)
{
    std::vector<std::uint64_t> histogram(65536, 0);
    for (const std::uint16_t value : image.values) {
        ++histogram[value];
    }
    Counts counts;
    for (std::size_t v = 0; v < histogram.size(); ++v) {
        if (histogram[v] > 0) {
            counts[static_cast<std::uint16_t>(v)] = histogram[v];
        }
    }
    return counts;
}

const LabelName* find(const std::vector<LabelName>& names, std::uint16_t value)
{
    const auto found = std::find_if(names.begin(), names.end(), [&](const LabelName& n) { return n.value == value; });
    return found == names.end() ? nullptr : &*found;
}

bool covers(const datasets::LabelMap& map, const Counts& counts)
{
    return std::all_of(counts.begin(), counts.end(),
                       [&](const auto& label) { return label.first == 0 || find(map.labels, label.first) != nullptr; });
}

// The file's own names agree with the map's for every label that is there.
bool namesAgree(const datasets::LabelMap& map, const std::vector<LabelName>& names, const Counts& counts)
{
    return std::all_of(counts.begin(), counts.end(), [&](const auto& label) {
        const LabelName* ours = find(map.labels, label.first);
        const LabelName* theirs = find(names, label.first);
        return label.first == 0 || (ours != nullptr && theirs != nullptr && ours->name == theirs->name);
    });
}

// Values that run almost without gaps from 1 on say nothing about who wrote them; 1, 2, 29, 33, 40, 88 ... do.
bool valuesTell(const Counts& counts)
{
    return counts.size() >= 6 && counts.rbegin()->first >= 2 * counts.size();
}

// The built-in map that the file was certainly made by, or none.
std::vector<LabelName> recognise(const volume::ImportedLabels& labels, const Counts& counts,
                                 std::vector<std::string>& notes)
{
    std::vector<datasets::LabelMap> byValue;
    for (const std::string& name : datasets::labelMapNames()) {
        datasets::LabelMap map = datasets::labelMap(name);
        if (!labels.names.empty() && namesAgree(map, labels.names, counts)) {
            notes.push_back(fmt::format("label map '{}' recognised by the names in the file", name));
            return map.labels;
        }
        if (labels.names.empty() && valuesTell(counts) && covers(map, counts)) {
            byValue.push_back(std::move(map));
        }
    }
    if (byValue.size() != 1) {
        return {};
    }
    notes.push_back(fmt::format("label map '{}' recognised by the label values: --map says otherwise", byValue[0].name));
    return byValue[0].labels;
}

[[noreturn]] void refuseUnknown(const ImportOptions& options, const std::vector<LabelName>& names, const Counts& unknown)
{
    std::vector<std::string> list;
    for (const auto& [value, voxels] : unknown) {
        const LabelName* name = find(names, value);
        list.push_back(
            fmt::format("{}{} ({} voxels)", value, name != nullptr ? fmt::format(" '{}'", name->name) : "", voxels));
    }
    throw std::runtime_error(fmt::format(
        "{}: no tissue is known for {} of its labels: {}: give --map ({} or a TOML file), or --default-tissue NAME",
        options.labels.string(), unknown.size(), fmt::join(list, ", "), fmt::join(datasets::labelMapNames(), ", ")));
}

// A name and a tissue for every label: from the map, else by the file's segment name, else the default tissue.
std::vector<LabelName> nameLabels(const ImportOptions& options, const volume::ImportedLabels& labels, const Counts& counts,
                                  const volume::TissueTable& table, std::vector<std::string>& notes)
{
    const std::vector<LabelName> map =
        options.map.empty() ? recognise(labels, counts, notes) : datasets::labelMap(options.map).labels;
    std::vector<LabelName> named;
    Counts unknown;
    for (const auto& [value, voxels] : counts) {
        const LabelName* mapped = find(map, value);
        const LabelName* own = find(labels.names, value);
        if (mapped != nullptr) {
            named.push_back(*mapped);
        } else if (own != nullptr && table.find(own->name)) {
            named.push_back({value, own->name, own->name});
        } else if (value != 0 && !options.defaultTissue.empty()) {
            named.push_back({value, own != nullptr ? own->name : fmt::format("label {}", value), options.defaultTissue});
            notes.push_back(fmt::format("label {} ({} voxels) is taken as {}", value, voxels, options.defaultTissue));
        } else if (value != 0) {
            unknown[value] = voxels;
        }
    }
    if (!unknown.empty()) {
        refuseUnknown(options, labels.names, unknown);
    }
    return named;
}

volume::Provenance provenanceOf(const ImportOptions& options, const volume::ImportedLabels& labels,
                                const std::vector<std::string>& notes)
{
    volume::Fnv hash;  // of the label values, x fastest: the same voxels give the same hash whatever file they came in
    hash.addAll(labels.image.values);
    volume::Provenance provenance = {{"source", options.labels.filename().string()},
                                     {"bytes", std::to_string(std::filesystem::file_size(options.labels))},
                                     {"label hash", fmt::format("{:016x}", hash.value)},
                                     {"imported", fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(std::time(nullptr)))},
                                     {"program", PALPATE_BUILD}};
    for (const std::string& note : notes) {
        provenance.emplace_back(warningKey, note);
    }
    return provenance;
}

void runImport(const ImportOptions& options)
{
    const volume::TissueTable table =
        options.tissues.empty() ? datasets::defaultTissues() : datasets::loadTissues(options.tissues);
    if (!options.defaultTissue.empty() && !table.find(options.defaultTissue)) {
        throw std::runtime_error(
            fmt::format("--default-tissue {}: is not in the tissue table '{}'", options.defaultTissue, table.name));
    }
    volume::ImportedLabels labels = volume::importLabels(options.labels);
    std::vector<std::string> notes = labels.warnings;
    const std::vector<LabelName> named = nameLabels(options, labels, countLabels(labels.image), table, notes);
    volume::Provenance provenance = provenanceOf(options, labels, notes);
    const volume::Tissue tissue = volume::Tissue::fromLabels(labels.image, table, named, std::move(provenance));
    labels.image.values = {};
    tissue.save(options.output);
    if (options.json != "-") {
        fmt::print("{} -> {}\n\n", options.labels.string(), options.output.string());
        printVolume(tissue);
    }
    if (!options.json.empty()) {
        writeJson(options.json, volumeFigures(tissue));
    }
}

}  // namespace

void addImport(CLI::App& app)
{
    const auto options = std::make_shared<ImportOptions>();
    CLI::App* command = app.add_subcommand("import", "Turn a label map (NIfTI, NRRD, MetaImage) into a volume of tissue");
    command->add_option("labels", options->labels, "Label map")->type_name("LABELS")->required();
    command->add_option("-o,--output", options->output, "Volume to write (.vdb)")->type_name("V.vdb")->required();
    command->add_option("--map", options->map, "What the labels are: a built-in map's name, or a TOML file")
        ->type_name("NAME|FILE");
    command->add_option("--tissues", options->tissues, "Tissue table in place of the built-in one")->type_name("FILE");
    command->add_option("--default-tissue", options->defaultTissue, "Tissue of labels that nothing else names")
        ->type_name("NAME");
    command->add_option("--json", options->json, "Write the figures here, - for standard output")->type_name("FILE");
    command->final_callback([options] { runImport(*options); });
}

}  // namespace palpate::apps
