#include <apps/command.h>
#include <base/outputs.h>
#include <base/quantities.h>
#include <command/json.h>
#include <command/progress.h>
#include <datasets/label_map.h>
#include <datasets/tables.h>
#include <report/volume.h>
#include <volume/fnv.h>
#include <volume/import.h>
#include <volume/prepare/body.h>
#include <volume/prepare/mapping.h>
#include <volume/prepare/name_table.h>
#include <volume/prepare/steps.h>
#include <volume/resample.h>

#include <base/build.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <cmath>
#include <ctime>
#include <memory>
#include <new>
#include <stdexcept>

namespace palpate::apps {

namespace {

namespace fs = std::filesystem;

struct Options {
    fs::path input, output, tissues, image, json;
    std::string stiffness, imageUnit;
    volume::ImportOptions reading;
    prepare::MappingOptions mapping;
    prepare::PreparationOptions steps;
    std::string voxel, closeSkinHoles, addSkin, pad, cropMargin, bodyFromHull;
    double hull = 0;  // thickness of a body that is invented [m]
    bool bodyFromImage = false;
    int imageVolume = 0;
};

void readLengths(Options& o)
{
    const auto set = [](double& target, const std::string& option, const std::string& text, double least, double most) {
        target = text.empty() ? target : base::lengthFrom(option, text, least, most);
    };
    set(o.steps.voxel, "--voxel", o.voxel, 0.05e-3, 50e-3);
    set(o.steps.addSkin, "--add-skin", o.addSkin, 0.05e-3, 50e-3);
    set(o.hull, "--body-from-hull", o.bodyFromHull, 2e-3, 0.2);
    set(o.steps.pad, "--pad", o.pad, 0.05e-3, 0.5);
    set(o.steps.cropMargin, "--crop-margin", o.cropMargin, 0, 1);
    if (o.steps.closeSkinHoles) {
        set(*o.steps.closeSkinHoles, "--close-skin-holes", o.closeSkinHoles, 0.05e-3, 0.5);
    }
}

// The image as its file has it, its unit as --image-unit has it.
volume::ImportedImage readImage(const Options& o, std::vector<std::string>& notes, command::Progress& progress)
{
    volume::ImportOptions reading;
    reading.series = o.reading.series;
    reading.volume = o.imageVolume;
    progress.show("checking the image");
    reading.progress = [&](double share) { progress.show("reading the image", share); };
    volume::ImportedImage image = volume::importImage(o.image, reading);
    for (const std::string& warning : image.warnings) {
        notes.push_back(fmt::format("{}: {}", o.image.filename().string(), warning));
    }
    if (!o.imageUnit.empty() && !image.what.empty() && image.what != o.imageUnit) {
        throw std::runtime_error(
            fmt::format("{}: says itself that it is in {}: leave --image-unit out", o.image.string(), image.what));
    }
    image.what = o.imageUnit.empty() ? image.what : o.imageUnit;
    if (o.bodyFromImage && image.what != "HU") {
        throw std::runtime_error(
            fmt::format("{}: --body-from-image needs CT in Hounsfield units: add --image-unit HU if it "
                        "is that, or invent a body with --body-from-hull MM",
                        o.image.string()));
    }
    return image;
}

// The image on the voxels of the labels.
volume::CompanionImage companionOf(const Options& o, const volume::ImportedImage& image, const volume::LabelImage& labels,
                                   const volume::TissueTable& table, std::vector<std::string>& notes)
{
    const volume::VoxelGrid from{image.size, image.affine}, to{labels.size, labels.affine};
    volume::CompanionImage companion;
    companion.unit = image.what;
    if (!o.stiffness.empty()) {
        companion.stiffness = datasets::stiffnessMap(o.stiffness, companion.unit, table);
    }
    const float missing = companion.unit == "HU" ? -1000.0F : 0.0F;
    companion.values = volume::resampledImage(from, image.values, to, std::nanf(""));
    std::uint64_t bare = 0, labelled = 0;
    for (std::size_t i = 0; i < companion.values.size(); ++i) {
        labelled += labels.values[i] != 0 ? 1 : 0;
        bare += std::isnan(companion.values[i]) && labels.values[i] != 0 ? 1 : 0;
        companion.values[i] = std::isnan(companion.values[i]) ? missing : companion.values[i];
    }
    if (2 * bare > labelled) {
        throw std::runtime_error(
            fmt::format("{}: it covers less than half of the labelled voxels of {}: give the image that the "
                        "segmentation was made of, in the same patient frame",
                        o.image.string(), o.input.filename().string()));
    }
    if (bare > 0) {
        notes.push_back(fmt::format("{} labelled voxels lie outside the image and have {} there{}", bare, missing,
                                    companion.stiffness.points.empty() ? "" : ", for their stiffness too"));
    }
    return companion;
}

// A body around the labels, as it is asked for; before anything else is done to them.
std::vector<prepare::PreparationStep> addBody(const Options& o, volume::LabelImage& labels,
                                              std::vector<volume::LabelName>& named, const volume::TissueTable& table,
                                              const volume::ImportedImage* image, std::vector<std::string>& notes,
                                              command::Progress& progress)
{
    const auto tell = [&](const std::string& what) { progress.show(what); };
    if (o.bodyFromImage) {
        const volume::VoxelGrid ct{image->size, image->affine};
        prepare::extendToImage(labels, ct);
        progress.show("resampling the image");
        auto hu = volume::resampledImage(ct, image->values, {labels.size, labels.affine}, std::nanf(""));
        return prepare::bodyFromImage(labels, named, std::move(hu), table, tell);
    }
    if (o.hull == 0) {
        return {};
    }
    notes.push_back(
        fmt::format("the body around the labels is invented: {:g} mm of soft tissue and skin that no image "
                    "shows",
                    1e3 * o.hull));
    return prepare::bodyFromHull(labels, named, o.hull, table, tell);
}

volume::Provenance provenanceOf(const Options& o, const volume::LabelImage& image, const std::vector<std::string>& notes,
                                const std::vector<prepare::PreparationStep>& steps)
{
    volume::Fnv hash;  // of the label values, x fastest: the same voxels give the same hash whatever file they came in
    hash.addAll(image.values);
    volume::Provenance provenance = {{"source", o.input.filename().string()},
                                     {"label hash", fmt::format("{:016x}", hash.value)},
                                     {"imported", fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(std::time(nullptr)))},
                                     {"program", std::string(base::build())}};
    std::error_code none;
    if (fs::is_regular_file(o.input, none)) {
        provenance.insert(provenance.begin() + 1, {"bytes", std::to_string(fs::file_size(o.input))});
    }
    if (!o.image.empty()) {
        provenance.emplace_back("image file", o.image.filename().string());
    }
    if (!o.stiffness.empty()) {
        provenance.emplace_back("stiffness", fmt::format("scaled by the image, map {}", o.stiffness));
    }
    for (const prepare::PreparationStep& step : steps) {
        provenance.emplace_back(report::stepKey, step.text);
    }
    for (const std::string& note : notes) {
        provenance.emplace_back(report::warningKey, note);
    }
    return provenance;
}

// What became of voxels that several segments hold: in one note, or with --verbose in one for each pair.
void noteOverlaps(const volume::ImportedLabels& labels, bool verbose, std::vector<std::string>& notes)
{
    const auto nameOf = [&](std::uint16_t value) {
        for (const volume::LabelName& n : labels.names) {
            if (n.value == value) {
                return n.name;
            }
        }
        return fmt::format("label {}", value);
    };
    std::uint64_t all = 0;
    const volume::Overlap* most = nullptr;
    for (const volume::Overlap& o : labels.overlaps) {
        all += o.voxels;
        most = most == nullptr || o.voxels > most->voxels ? &o : most;
        if (verbose || labels.overlaps.size() == 1) {
            notes.push_back(fmt::format("{} voxels of '{}' lie in '{}' too, which has them: --overlap says otherwise",
                                        o.voxels, nameOf(o.lost), nameOf(o.kept)));
        }
    }
    if (!verbose && labels.overlaps.size() > 1) {
        notes.push_back(
            fmt::format("{} voxels lie in several segments, in {} pairs of them, the most of '{}' in '{}' ({}): "
                        "--overlap says who has them, --verbose lists each pair",
                        all, labels.overlaps.size(), nameOf(most->lost), nameOf(most->kept), most->voxels));
    }
}

nlohmann::json figuresOf(const volume::Tissue& tissue, const volume::ImportedLabels& labels,
                         const std::vector<prepare::PreparationStep>& steps)
{
    nlohmann::json figures = report::volumeFigures(tissue);
    figures["steps"] = prepare::stepFigures(steps);
    figures["overlaps"] = nlohmann::json::array();
    for (const volume::Overlap& o : labels.overlaps) {
        figures["overlaps"].push_back({{"kept", o.kept}, {"lost", o.lost}, {"voxels", o.voxels}});
    }
    return figures;
}

void checkOptions(const Options& o)
{
    if (o.output.empty() == o.mapping.writeMap.empty()) {
        throw std::runtime_error("palpate import: give -o V.vdb, or --write-map FILE to begin a label map instead");
    }
    if (!o.output.empty() && o.output.extension() != ".vdb") {
        throw std::runtime_error(o.output.string() + ": a volume is a .vdb file: name it so");
    }
    if (!o.stiffness.empty() && o.image.empty()) {
        throw std::runtime_error("--stiffness-from: needs the image: add --image FILE");
    }
    if (o.bodyFromImage && o.image.empty()) {
        throw std::runtime_error("--body-from-image: needs the image: add --image FILE");
    }
    if (!o.imageUnit.empty() && o.image.empty()) {
        throw std::runtime_error("--image-unit: needs the image: add --image FILE");
    }
    base::checkOutput(o.output);
    base::checkOutput(o.mapping.writeMap);
    base::checkOutput(o.json);
}

void runImport(Options o)
{
    readLengths(o);
    checkOptions(o);
    const volume::TissueTable table = o.tissues.empty() ? datasets::defaultTissues() : datasets::loadTissues(o.tissues);
    command::Progress progress(command::Progress::Clock::ticking);
    progress.show("checking the file");
    o.reading.sheared = o.steps.voxel > 0;
    o.reading.progress = [&](double share) { progress.show("reading", share); };
    volume::ImportedLabels labels = volume::importLabels(o.input, o.reading);
    progress.show("counting labels");
    const prepare::LabelCounts counts = prepare::countLabels(labels.image);
    prepare::addNames(o.mapping, o.input, counts, labels);
    if (!o.mapping.writeMap.empty()) {
        const std::size_t open = prepare::writeLabelMap(o.mapping, o.input, labels, counts, table);
        progress.clear();
        fmt::print("{}: {} labels, {} of them to be filled in\n", o.mapping.writeMap.string(), counts.size(), open);
        return;
    }
    std::vector<std::string> notes = labels.warnings;
    noteOverlaps(labels, o.mapping.verbose, notes);
    std::vector<volume::LabelName> named = prepare::mapLabels(o.mapping, o.input, labels, counts, table, notes);
    std::optional<volume::ImportedImage> image;
    if (!o.image.empty()) {
        image = readImage(o, notes, progress);
    }
    auto steps = addBody(o, labels.image, named, table, image ? &*image : nullptr, notes, progress);
    for (auto& step :
         prepare::prepare(labels.image, named, table, o.steps, [&](const auto& what) { progress.show(what); })) {
        steps.push_back(std::move(step));
    }
    std::optional<volume::CompanionImage> companion;
    if (image) {
        progress.show("resampling the image");
        companion = companionOf(o, *image, labels.image, table, notes);
        image.reset();
    }
    progress.show("making tissue");
    volume::Provenance provenance = provenanceOf(o, labels.image, notes, steps);
    const volume::Tissue tissue =
        volume::Tissue::fromLabels(labels.image, table, named, std::move(provenance), companion ? &*companion : nullptr);
    labels.image.values = {};
    companion.reset();
    progress.show("writing");
    tissue.save(o.output);
    progress.clear();
    if (o.json != "-") {
        fmt::print("{} -> {}\n\n", o.input.string(), o.output.string());
        report::printVolume(tissue);
    }
    if (!o.json.empty()) {
        command::writeJson(o.json, figuresOf(tissue, labels, steps));
    }
}

void addReading(CLI::App& command, Options& o)
{
    command
        .add_option("--overlap", o.reading.overlap,
                    "Segment that a voxel of several belongs to: smallest (default), first, last, or names, later ones win")
        ->type_name("RULE|NAMES")
        ->delimiter(',')
        ->group("Reading");
    command.add_option("--series", o.reading.series, "SeriesInstanceUID to take of a folder of several")
        ->type_name("UID")
        ->group("Reading");
    command
        .add_option("--threshold", o.reading.fractionalThreshold,
                    "From which a probability of a fractional DICOM SEG is tissue (default 0.5)")
        ->check(CLI::Range(0.0, 1.0))
        ->group("Reading");
    command.add_option("--volume", o.reading.volume, "Which volume of a file with several (4D), from 1")
        ->check(CLI::Range(1, 1 << 30))
        ->type_name("N")
        ->group("Reading");
    command.add_flag("--renumber", o.reading.renumber, "Give values that are negative or over 65535 free label values")
        ->group("Reading");
    command.add_flag("--round", o.reading.round, "Take values within 0.001 of a whole number as that")->group("Reading");
    command
        .add_option("--axes", o.reading.axes,
                    "Sides to which the voxel axes run, where the file does not say it: LPS, RAS, LAS, ...")
        ->type_name("XYZ")
        ->group("Reading");
    command.add_flag("--dicom-labels", o.reading.dicomLabels, "Take the values of a DICOM series of CT, MR, ... as labels")
        ->group("Reading");
    command.add_option("--image-volume", o.imageVolume, "Which volume of an image with several (4D), from 1")
        ->check(CLI::Range(1, 1 << 30))
        ->type_name("N")
        ->group("Reading");
    command.add_option("--image", o.image, "CT or MR of the same patient, on any grid, kept with the labels")
        ->type_name("FILE")
        ->group("Reading");
    command.add_option("--image-unit", o.imageUnit, "HU: the image is CT in Hounsfield units; only DICOM says so itself")
        ->check(CLI::IsMember({"HU"}))
        ->group("Reading");
    command
        .add_option("--stiffness-from", o.stiffness,
                    "Scale Young's modulus by the image: the built-in map hu, or a TOML file (docs/scenes.md)")
        ->type_name("hu|FILE")
        ->group("Reading");
}

void addMapping(CLI::App& command, Options& o)
{
    command.add_option("--map,--labels", o.mapping.map, "What the labels are: a built-in label map's name, or a TOML file")
        ->type_name("NAME|FILE")
        ->group("Tissue");
    command
        .add_option("--names", o.mapping.names,
                    "Names of the labels: a colour table (3D Slicer, FreeSurfer, ITK-SNAP) or a dataset.json")
        ->type_name("FILE")
        ->group("Tissue");
    command
        .add_flag_callback(
            "--list-maps",
            [] {
                for (const datasets::LabelMap& map : datasets::labelMaps()) {
                    fmt::print("{:<44} {:>4} labels  {}\n", map.name, map.labels.size(), map.source);
                }
                throw CLI::Success();
            },
            "List the built-in label maps with their sources, and stop")
        ->trigger_on_parse()
        ->group("Tissue");
    command.add_flag("--verbose", o.mapping.verbose, "A warning for each label and each overlap, not one for all")
        ->group("Tissue");
    command.add_option("--set", o.mapping.set, "Tissue of one label, by its name or value; may be repeated")
        ->type_name("LABEL=TISSUE")
        ->group("Tissue");
    command.add_option("--default-tissue", o.mapping.defaultTissue, "Tissue of labels that nothing else names")
        ->type_name("NAME")
        ->group("Tissue");
    command
        .add_option("--write-map", o.mapping.writeMap,
                    "Write a label map to edit, with what is known of the labels, and stop")
        ->type_name("FILE")
        ->group("Tissue");
    CLI::Option* const fromImage =
        command
            .add_option_function<std::vector<std::string>>(
                "--body-from-image", [&o](const std::vector<std::string>&) { o.bodyFromImage = true; },
                "Find skin, fat, muscle, bone, lung and vessels around the labels in the image, which is CT")
            ->expected(0, 1)
            ->check(CLI::IsMember({"ct"}))
            ->type_name("[ct]")
            ->group("Tissue");
    command.add_option("--body-from-hull", o.bodyFromHull, "Invent so much soft tissue and skin around the labels")
        ->type_name("MM")
        ->excludes(fromImage)
        ->group("Tissue");
    command.add_option("--tissues", o.tissues, "Tissue table in place of the built-in one")
        ->type_name("FILE")
        ->group("Tissue");
}

void addSteps(CLI::App& command, Options& o)
{
    const char* group = "Changes, done in this order; lengths in mm, or with a unit";
    command
        .add_option("--crop", o.steps.crop, "Keep a box around all tissue, around a structure, or x0,x1,y0,y1,z0,z1 in LPS")
        ->type_name("tissue|NAME|BOX")
        ->group(group);
    command.add_option("--crop-margin", o.cropMargin, "Around the structure (default 10)")->type_name("MM")->group(group);
    command.add_option("--voxel", o.voxel, "Resample to cubes; straightens sheared grids")->type_name("MM")->group(group);
    command
        .add_option_function<std::vector<std::string>>(
            "--largest-component",
            [&o](const std::vector<std::string>& names) {
                o.steps.largest = true;
                for (const std::string& name : names) {
                    if (!name.empty()) {
                        o.steps.largestOf.push_back(name);
                    }
                }
            },
            "Keep only the largest piece of every label, or of this one")
        ->expected(0, 1)
        ->type_name("[NAME]")
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
        ->group(group);
    command
        .add_option_function<std::vector<std::string>>(
            "--close-skin-holes",
            [&o](const std::vector<std::string>& size) {
                o.steps.closeSkinHoles = 10e-3;
                o.closeSkinHoles = size.empty() ? "" : size[0];
            },
            "Close holes in the skin up to this size (10)")
        ->expected(0, 1)
        ->type_name("[MM]")
        ->group(group);
    command.add_option("--add-skin", o.addSkin, "Make the outermost layer of tissue skin")->type_name("MM")->group(group);
    command.add_option("--pad", o.pad, "Add outside on all sides")->type_name("MM")->group(group);
}

}  // namespace

void addImport(CLI::App& app)
{
    const auto o = std::make_shared<Options>();
    CLI::App* command = app.add_subcommand(
        "import", "Turn a segmentation (NIfTI, NRRD, MetaImage, DICOM, OpenVDB, folder) into a volume of tissue");
    command->add_option("input", o->input, "Label map or segmentation: a file, or a folder of masks or of DICOM")
        ->type_name("LABELS")
        ->required();
    command->add_option("-o,--output", o->output, "Volume to write")->type_name("V.vdb");
    command->add_option("--json", o->json, "Write the figures here, - for standard output")->type_name("FILE");
    addReading(*command, *o);
    addMapping(*command, *o);
    addSteps(*command, *o);
    command->final_callback([o] {
        try {
            runImport(*o);
        } catch (const std::bad_alloc&) {
            throw std::runtime_error(o->input.string() +
                                     ": needs more memory than there is: crop it, or resample it to larger voxels");
        }
    });
}

}  // namespace palpate::apps
