#include <apps/command.h>
#include <base/error.h>
#include <base/mapped.h>
#include <base/outputs.h>
#include <base/quantities.h>
#include <command/json.h>
#include <command/progress.h>
#include <datasets/label_map.h>
#include <datasets/tables.h>
#include <report/volume.h>
#include <volume/prepare/volume_import.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <memory>
#include <new>
#include <optional>

namespace palpate::apps {

namespace {

namespace fs = std::filesystem;

struct ImportArguments : prepare::ImportRequest {
    fs::path output, tissues, json;
    std::string voxel, sliceSpacing, closeSkinHoles, addSkin, pad, cropMargin, bodyFromHull;  // as they were typed
};

void readLengths(ImportArguments& o)
{
    const auto set = [](double& target, const std::string& text, const prepare::LengthBounds& bounds) {
        target = text.empty() ? target : base::lengthFrom(bounds.option, text, bounds.least, bounds.most);
    };
    set(o.steps.voxel, o.voxel, prepare::voxelBounds);
    set(o.reading.sliceSpacing, o.sliceSpacing, prepare::sliceBounds);
    set(o.steps.addSkin, o.addSkin, prepare::skinBounds);
    set(o.hull, o.bodyFromHull, prepare::hullBounds);
    set(o.steps.pad, o.pad, prepare::padBounds);
    set(o.steps.cropMargin, o.cropMargin, prepare::cropBounds);
    if (o.steps.closeSkinHoles) {
        set(*o.steps.closeSkinHoles, o.closeSkinHoles, prepare::holesBounds);
    }
}

nlohmann::json importFigures(const prepare::ImportedVolume& made)
{
    nlohmann::json figures = report::volumeFigures(made.tissue);
    figures["steps"] = prepare::stepFigures(made.steps);
    figures["overlaps"] = base::mapped<nlohmann::json>(made.overlaps, [](const volume::Overlap& o) {
        return nlohmann::json{{"kept", o.kept}, {"lost", o.lost}, {"voxels", o.voxels}};
    });
    return figures;
}

// Whether figures would replace a file of somebody else in a folder that is read.
bool replacesForeign(const ImportArguments& o)
{
    std::error_code none;
    if (!fs::is_directory(o.input, none) || !fs::is_regular_file(o.json, none)) {
        return false;
    }
    const fs::path within = fs::weakly_canonical(o.json, none).lexically_relative(fs::weakly_canonical(o.input, none));
    if (within.empty() || *within.begin() == "..") {
        return false;
    }
    std::ifstream in(o.json);
    const auto there = nlohmann::json::parse(in, nullptr, false);
    return !there.is_object() || !there.contains("overlaps") || !there.contains("labels");  // see importFigures()
}

void checkOptions(const ImportArguments& o)
{
    base::failIf(o.output.empty() == o.mapping.writeMap.empty(),
                 "palpate import: give -o V.vdb, or --write-map FILE to begin a label map instead");
    base::failIf(!o.output.empty() && o.output.extension() != ".vdb", "{}: a volume is a .vdb file: name it so",
                 o.output.native());
    prepare::checkRequest(o);
    base::checkOutputs({o.output, o.mapping.writeMap, o.json},
                       {o.input, o.image, o.stiffness, o.tissues, o.mapping.map, o.mapping.names});
    prepare::checkReplaced(o, {o.output, o.mapping.writeMap, o.json});
    base::failIf(replacesForeign(o),
                 "{}: is there already, in the folder that is read, and no import wrote it: give --json another name, or "
                 "remove it",
                 o.json.native());
    std::error_code none;
    base::failIf(fs::is_regular_file(o.mapping.writeMap, none),
                 "{}: is there already, perhaps with what you filled in: give --write-map another name, or remove it",
                 o.mapping.writeMap.native());
}

void runImport(ImportArguments o)
{
    readLengths(o);
    checkOptions(o);
    const volume::TissueTable table = o.tissues.empty() ? datasets::defaultTissues() : datasets::loadTissues(o.tissues);
    command::Progress progress(command::Progress::Clock::ticking);
    const auto tell = [&](const std::string& what, std::optional<double> fraction) {
        fraction ? progress.show(what, *fraction) : progress.show(what);
    };
    o.reading.sheared = o.steps.voxel > 0;
    if (!o.mapping.writeMap.empty()) {
        const auto [labels, counts] = prepare::readLabels(o, tell);
        const prepare::BegunMap begun = prepare::writeLabelMap(o.mapping, o.input, labels, counts, table);
        progress.clear();
        fmt::print("{}: {} labels, {} of them to be filled in\n", o.mapping.writeMap.string(), begun.labels, begun.open);
        return;
    }
    const prepare::ImportedVolume made = prepare::importVolume(o, table, tell);
    progress.show("writing");
    made.tissue.save(o.output);
    progress.clear();
    if (o.json != "-") {
        fmt::print("{} -> {}\n\n", o.input.string(), o.output.string());
        report::printVolume(made.tissue);
    }
    command::writeJson(o.json, importFigures(made));
}

void addReading(CLI::App& command, ImportArguments& o)
{
    command.option_defaults()->group("Reading");
    command
        .add_option("--overlap", o.reading.overlap,
                    "Segment of a voxel in several segments: smallest (default), first, last, or names; later names win")
        ->type_name("RULE|NAMES")
        ->delimiter(',');
    command.add_option("--series", o.reading.series, "SeriesInstanceUID to read from a folder with several series")
        ->type_name("UID");
    command
        .add_option("--slice-spacing", o.sliceSpacing,
                    "Distance between the slices of a DICOM SEG that omits slices and does not define it")
        ->type_name("MM");
    command
        .add_option("--threshold", o.reading.fractionalThreshold,
                    "Lowest probability of tissue in a fractional DICOM SEG (default: 0.5)")
        ->check(CLI::Range(0.0, 1.0));
    command.add_option("--volume", o.reading.volume, "Number of the volume in a 4D file, from 1")
        ->check(CLI::Range(1, 1 << 30))
        ->type_name("N");
    command.add_flag("--renumber", o.reading.renumber, "Replace values below 0 or above 65535 by free label values");
    command.add_flag("--round", o.reading.round, "Round values that are within 0.001 of a whole number");
    command
        .add_option("--axes", o.reading.axes,
                    "Directions of the voxel axes, if the file does not define them: LPS, RAS, LAS, ...")
        ->type_name("XYZ");
    command.add_flag("--dicom-labels", o.reading.dicomLabels, "Read the values of a DICOM series (CT, MR, ...) as labels");
    command.add_option("--image-volume", o.imageVolume, "Number of the volume in a 4D image, from 1")
        ->check(CLI::Range(1, 1 << 30))
        ->type_name("N");
    command
        .add_option("--image-axes", o.imageAxes,
                    "Directions of the image's voxel axes, if its file does not define them (default: as --axes)")
        ->type_name("XYZ");
    command
        .add_option("--image-series", o.imageSeries,
                    "SeriesInstanceUID of the image in a folder with several series (default: that of the DICOM SEG)")
        ->type_name("UID");
    command.add_flag("--ignore-frame-of-reference", o.ignoreFrame,
                     "Accept an image whose DICOM frame of reference is not that of the labels");
    command.add_option("--image", o.image, "CT or MR of the same patient, on any grid, kept with the labels")
        ->type_name("FILE");
    command.add_option("--image-unit", o.imageUnit, "HU: the image is CT in Hounsfield units; not needed for DICOM")
        ->check(CLI::IsMember({"HU"}));
    command
        .add_option("--stiffness-from", o.stiffness,
                    "Scale Young's modulus by the image: the built-in map hu, or a TOML file (docs/scenes.md)")
        ->type_name("hu|FILE");
}

void addMapping(CLI::App& command, ImportArguments& o)
{
    command.option_defaults()->group("Tissue");
    command
        .add_option("--map,--labels", o.mapping.map,
                    "Label map that assigns tissues to labels: a built-in name, or a TOML file")
        ->type_name("NAME|FILE");
    command
        .add_option("--names", o.mapping.names,
                    "Names of the labels: a colour table (3D Slicer, FreeSurfer, ITK-SNAP) or a dataset.json")
        ->type_name("FILE");
    command
        .add_flag_callback(
            "--list-maps",
            [] {
                for (const datasets::LabelMap& map : datasets::labelMaps()) {
                    fmt::print("{:<44} {:>4} labels  {}\n", map.name, map.labels.size(), map.source);
                }
                throw CLI::Success();
            },
            "List the built-in label maps with their sources, and exit")
        ->trigger_on_parse();
    command.add_flag("--verbose", o.mapping.verbose, "Print a warning for each label and each overlap, not one for all");
    command.add_option("--set", o.mapping.set, "Tissue of one label, by its name or value; may be repeated")
        ->type_name("LABEL=TISSUE");
    command.add_option("--default-tissue", o.mapping.defaultTissue, "Tissue of labels that are not assigned otherwise")
        ->type_name("NAME");
    command.add_option("--write-map", o.mapping.writeMap, "Write a label map to edit, filled in as far as known, and exit")
        ->type_name("FILE");
    CLI::Option* const fromImage =
        command
            .add_option_function<std::vector<std::string>>(
                "--body-from-image", [&o](const std::vector<std::string>&) { o.bodyFromImage = true; },
                "Segment skin, fat, muscle, bone, lung and vessels around the labels in the CT image")
            ->expected(0, 1)
            ->check(CLI::IsMember({"ct"}))
            ->type_name("[ct]");
    command
        .add_option("--body-from-hull", o.bodyFromHull,
                    "Add this thickness of invented soft tissue and skin around the labels [mm]")
        ->type_name("MM")
        ->excludes(fromImage);
    command.add_option("--tissues", o.tissues, "Tissue table instead of the built-in one")->type_name("FILE");
}

void addSteps(CLI::App& command, ImportArguments& o)
{
    command.option_defaults()->group("Changes, done in this order; lengths in mm, or with a unit");
    CLI::Option* const crop =
        command
            .add_option("--crop", o.steps.crop,
                        "Keep a box around all tissue, around a structure, or x0,x1,y0,y1,z0,z1 in LPS")
            ->type_name("tissue|NAME|BOX");
    command.add_option("--crop-margin", o.cropMargin, "Margin around the structure or tissue (default: 10)")
        ->type_name("MM")
        ->needs(crop);
    command.add_option("--voxel", o.voxel, "Resample to cubes of this edge length; straightens sheared grids")
        ->type_name("MM");
    command
        .add_option_function<std::vector<std::string>>(
            "--largest-component",
            [&o](const std::vector<std::string>& names) {
                o.steps.largest = true;
                std::ranges::remove_copy(names, std::back_inserter(o.steps.largestOf), "");
            },
            "Keep only the largest piece of every label, or of this one")
        ->expected(0, 1)
        ->type_name("[NAME]")
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    command
        .add_option_function<std::vector<std::string>>(
            "--close-skin-holes",
            [&o](const std::vector<std::string>& size) {
                o.steps.closeSkinHoles = 10e-3;
                o.closeSkinHoles = size.empty() ? "" : size[0];
            },
            "Close holes in the skin up to this size (default: 10)")
        ->expected(0, 1)
        ->type_name("[MM]");
    command.add_option("--add-skin", o.addSkin, "Turn the outermost layer of tissue, of this thickness, into skin")
        ->type_name("MM");
    command.add_option("--pad", o.pad, "Add air of this width on all sides")->type_name("MM");
}

}  // namespace

void addImport(CLI::App& app)
{
    const auto o = std::make_shared<ImportArguments>();
    CLI::App* command = app.add_subcommand(
        "import", "Turn a segmentation (NIfTI, NRRD, MetaImage, DICOM, OpenVDB, folder) into a volume of tissue");
    command->add_option("input", o->input, "Label map or segmentation: a file, or a folder of masks or of DICOM")
        ->type_name("LABELS")
        ->required();
    command->add_option("-o,--output", o->output, "Volume to write")->type_name("V.vdb");
    command->add_option("--json", o->json, "Write figures to this file (- = standard output)")->type_name("FILE");
    addReading(*command, *o);
    addMapping(*command, *o);
    addSteps(*command, *o);
    command->final_callback([o] {
        try {
            runImport(*o);
        } catch (const std::bad_alloc&) {
            throw base::error("{}: needs more memory than this machine has: crop it, or resample it to larger voxels",
                              o->input.native());
        }
    });
}

}  // namespace palpate::apps
