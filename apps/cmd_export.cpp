#include <apps/command.h>
#include <base/error.h>
#include <base/folds.h>
#include <base/outputs.h>
#include <base/quantities.h>
#include <base/window_size.h>
#include <channel/deformation.h>
#include <command/json.h>
#include <command/options.h>
#include <command/progress.h>
#include <ct/scanner.h>
#include <datasets/label_map.h>
#include <haptics/recorder.h>
#include <haptics/score.h>
#include <session/deformed_state.h>
#include <session/open.h>
#include <ultrasound/placement.h>
#include <ultrasound/scanner.h>
#include <ultrasound/stored_image.h>
#include <volume/export.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <utility>

namespace palpate::apps {

namespace {

namespace fs = std::filesystem;

const std::vector<std::string> whatChoices{"labels", "image", "stiffness", "displacement", "inverse", "ultrasound", "ct"};

const std::vector<std::string> windowChoices{"soft-tissue", "lung", "bone"};

struct ExportArguments {
    fs::path volume, output, map, json, like;
    int width = 800, height = 600;
    std::string record, at, what, window = "soft-tissue";
    bool nifti2 = false;
};

bool isVtu(const fs::path& file)
{
    return file.extension() == ".vtu" || file.extension() == ".VTU";
}

bool isPng(const fs::path& file)
{
    return file.extension() == ".png" || file.extension() == ".PNG";
}

bool ofRecordOnly(const std::string& what)
{
    return what == "displacement" || what == "inverse" || what == "ultrasound" || what == "ct";
}

void checkOptions(ExportArguments& o)
{
    if (o.what.empty()) {
        o.what = isVtu(o.output) ? "displacement" : isPng(o.output) ? "ultrasound" : "labels";
    }
    base::failIf(o.volume.empty() == o.record.empty(),
                 "palpate export: give a volume (V.vdb), or a record (--record FILE --at TIME)");
    base::failIf((o.what == "ultrasound" || o.what == "ct") != isPng(o.output),
                 "{}: ultrasound and ct are written as .png, all else is not: change the file's name or --what",
                 o.output.native());
    base::failIf(!o.like.empty() && (o.what != "ultrasound" || !o.at.empty()),
                 "--like: needs --record FILE and -o FILE.png, and takes the time from the picture: leave out --at");
    base::failIf(
        o.like.empty() && o.record.empty() != o.at.empty(), "{}",
        o.at.empty() ? "--record: needs a time of the session: add --at 3.2s" : "--at: needs a record: add --record FILE");
    base::failIf(o.record.empty() && ofRecordOnly(o.what), "{}: {} needs a session: give --record FILE --at TIME",
                 o.output.native(), o.what);
    base::failIf(!o.record.empty() && !ofRecordOnly(o.what) && o.what != "labels",
                 "--what {}: does not change in a session: export it from the volume", o.what);
    base::failIf(isVtu(o.output) && o.what != "displacement",
                 "{}: a .vtu holds the displacement of a record's nodes, not {}: name it .nii.gz "
                 "or .nrrd",
                 o.output.native(), o.what);
    base::failIf(!o.map.empty() && o.what != "labels", "--write-map: needs --what labels");
    if (!isVtu(o.output) && !isPng(o.output)) {
        volume::checkExportName(o.output, o.record.empty() ? "" : "; of a record also .vtu and .png");
    }
    base::checkOutputs({o.output, volume::exportedDataOf(o.output), o.map, o.json}, {o.volume, o.record, o.like});
}

bool isCtRecord(const haptics::Record& record)
{
    return haptics::scanDoseOf(record.info()) > 0;
}

// What would change nothing in what is written is a mistake.
void checkUse(const CLI::App& command, const ExportArguments& o)
{
    const auto refuse = [&](const char* option, bool used, const char* why) {
        base::failIf(command.count(option) > 0 && !used, "{}: {}: leave it out", option, why);
    };
    const bool ct = o.what == "ct", picture = o.what == "ultrasound" && o.like.empty();
    refuse("--width", picture, "is for an ultrasound picture, and not with --like");
    refuse("--height", ct || picture, "is for a CT scan or an ultrasound picture, and not with --like");
    refuse("--window", ct, "is for a CT scan");
    refuse("--nifti2", volume::isNifti(o.output), "is for .nii and .nii.gz");
}

double timeFrom(const std::string& text)
{
    const auto plain = base::timeOf(text + "s");
    const auto time = plain ? plain : base::timeOf(text);
    base::failIf(!time, "--at {}: must be a time, 3.2s or 3200ms", text);
    return *time;
}

// Names, colours and terms of the structures; a structure without a colour of its own has its tissue's.
std::vector<volume::LabelName> namesOf(const volume::Tissue& tissue)
{
    std::vector<volume::LabelName> names;
    for (const volume::Structure& s : tissue.structures()) {
        const volume::TissueRow& row = tissue.table().rows[s.tissue];
        volume::LabelName name{s.value, s.name, row.name, s.colour, s.terminology};
        if (!name.colour) {
            std::array<std::uint8_t, 3> rgb{};
            for (int k = 0; k < 3; ++k) {
                rgb[static_cast<std::size_t>(k)] = static_cast<std::uint8_t>(std::lround(255.0F * row.colour[k]));
            }
            name.colour = rgb;
        }
        names.push_back(std::move(name));
    }
    return names;
}

void writeMap(const ExportArguments& o, const volume::Tissue& tissue)
{
    if (o.map.empty()) {
        return;
    }
    datasets::LabelMap map{
        o.volume.empty() ? fs::path(o.record).stem().string() : o.volume.stem().string(), namesOf(tissue), {}};
    base::writeWhole(o.map, fmt::format("# Names and tissues of the labels in {}: palpate import --map.\n{}",
                                        o.output.filename().string(), datasets::labelMapText(map)));
}

std::vector<float> stiffnessOf(const volume::Tissue& tissue)
{
    const volume::LabelImage places{tissue.size(), tissue.affine(), {}};
    std::vector<float> kilopascal(places.offset({0, 0, places.size.z}));
    const volume::Tissue::Reader reader(tissue);
    volume::forEachIndex(Index3(0), places.size - 1, [&](Index3 n) {
        kilopascal[places.offset(n)] = static_cast<float>(1e-3 * reader.youngsModulus(places.affine.toPatient(Vec3(n))));
    });
    return kilopascal;
}

void exportVolume(const ExportArguments& o, const volume::ExportOptions& how)
{
    const volume::Tissue tissue = session::loadVolume(o.volume);
    const volume::VoxelGrid grid{tissue.size(), tissue.affine()};
    if (o.what == "labels") {
        volume::exportLabels(o.output, tissue.labels(), namesOf(tissue), how);
        writeMap(o, tissue);
    } else if (o.what == "stiffness") {
        volume::exportImage(o.output, grid, stiffnessOf(tissue), how);
    } else if (const auto image = tissue.companion()) {
        volume::exportImage(o.output, grid, image->values, how);
    } else {
        throw base::error("{}: holds no image: give one to 'palpate import --image'", o.volume.native());
    }
}

// What to say of it behind the file's name.
std::string exportState(const ExportArguments& o, haptics::Record record, const volume::ExportOptions& how,
                        const std::function<void(double)>& progress, nlohmann::json& figures)
{
    const session::DeformedState state(std::move(record), timeFrom(o.at), progress);
    const auto& lattice = state.model().lattice;
    if (o.what == "labels") {
        volume::exportLabels(o.output, state.labels(), namesOf(*state.model().tissue), how);
        writeMap(o, *state.model().tissue);
    } else if (isVtu(o.output)) {
        volume::exportVtu(o.output, lattice.grid, lattice.tissue, state.shape().u());
    } else {
        volume::exportVectors(o.output, state.grid(), o.what == "inverse" ? state.inverse() : state.displacement(), how);
    }
    const double most = base::largestOf(state.shape().moved(), [&](chainmail::Node n) {
        return 1e3 * static_cast<double>(glm::length(state.shape().u()[n]));
    });
    figures["tick"] = state.tick();
    figures["moved_nodes"] = state.shape().moved().size();
    figures["largest_displacement_mm"] = most;
    return fmt::format(" at tick {}: {} nodes moved, by up to {:.2f} mm", state.tick(), state.shape().moved().size(), most);
}

// A CT scan of a record's body at one moment, as a viewer would show it. Returns what to say of it, as those around.
std::string exportCt(const ExportArguments& o, const haptics::Record& record, const std::function<void(double)>& progress)
{
    base::failIf(!isCtRecord(record), "{}: its scene has no CT: take a record of a scene with a section [ct]", o.record);
    const session::ShownState shown = session::shownState(record, timeFrom(o.at), std::nullopt, progress);
    const haptics::Showing& s = shown.showing;
    channel::Deformation body(s.scenery, s.labels);
    body.apply(*shown.shape);
    const ct::Scan scan = ct::Scanner(s.scenery, s.image).scan(shown.state, body);
    const auto& window = *std::ranges::find(ct::windows, o.window, &ct::Window::name);
    base::writeWhole(o.output, ct::scanPng(scan, shown.state.tick, s.scenery.ctDoseLength, window, o.height));
    return fmt::format(" at tick {}: {} slices of {:.1f} mm, {:.1f} mGy cm", shown.state.tick, scan.hu.size(),
                       1e3 * s.scenery.ctWidth, s.scenery.ctDoseLength);
}

// The ultrasound picture of a record at one moment, bit for bit as a viewer stores it: with probe, settings, size and
// moment of the stored image `like`, or the session's own.
std::string exportUltrasound(const ExportArguments& o, const haptics::Record& record,
                             const std::function<void(double)>& progress)
{
    base::failIf(isCtRecord(record),
                 "{}: its scene is guided by CT and has no ultrasound picture: leave out --what ultrasound and --like",
                 o.record);
    const auto like = o.like.empty() ? std::nullopt : std::optional(ultrasound::readStored(o.like));
    const double at = like ? static_cast<double>(like->image.tick) / record.info().rate : timeFrom(o.at);
    const session::ShownState shown =
        session::shownState(record, at, like ? std::optional(like->image.shapeTick) : std::nullopt, progress);
    const haptics::Showing& s = shown.showing;
    ultrasound::Scanner scanner(s.scenery, s.labels, s.fine);
    channel::Deformation body(s.scenery, s.labels);
    body.apply(*shown.shape);
    // Pictures of before do not say of which body they are.
    const bool told = like && like->image.body != 0;
    base::failIf(told && like->image.body != scanner.body(), "{}: is a picture of another body than that of {}",
                 o.like.native(), o.record);
    ultrasound::BeamImage image;
    image.shapeTick = shown.shape->tick;
    image.mirrored = like && like->image.mirrored;
    if (like) {
        scanner.scan(like->image.transducer, like->image.settings, like->image.pose, body, shown.state, image);
    } else {
        const auto e = ultrasound::examinationOf(s.scenery, scanner.medium());
        scanner.scan(e.transducer, e.settings, ultrasound::poseAt(e, shown.state), body, shown.state, image);
    }
    image.body = like && !told ? 0 : image.body;
    base::writeWhole(o.output,
                     ultrasound::storedImage(image, like ? like->width : o.width, like ? like->height : o.height));
    return fmt::format(" at tick {}: {} probe, {:.0f} mm deep", shown.state.tick,
                       image.transducer.shape == ultrasound::ProbeShape::curved ? "curved" : "linear",
                       1e3F * image.settings.depth);
}

void runExport(const CLI::App& app, ExportArguments o)
{
    const bool usual = o.what.empty();
    checkOptions(o);
    std::optional<haptics::Record> record;
    if (usual && o.what == "ultrasound" && o.like.empty()) {
        o.what = isCtRecord(record.emplace(o.record)) ? "ct" : o.what;
    }
    checkUse(app, o);
    if (!o.record.empty() && !record) {
        record.emplace(o.record);
    }
    command::Progress progress(command::Progress::Clock::ticking);
    progress.show("reading");
    volume::ExportOptions how;
    how.nifti2 = o.nifti2;
    how.progress = [&](double fraction) { progress.show("writing", fraction); };
    nlohmann::json figures{{"file", o.output.string()}, {"what", o.what}};
    std::string more;
    const auto again = [&](double fraction) { progress.show("computing the session again", fraction); };
    if (!record) {
        exportVolume(o, how);
    } else if (o.what == "ultrasound") {
        more = exportUltrasound(o, *record, again);
    } else if (o.what == "ct") {
        more = exportCt(o, *record, again);
    } else {
        more = exportState(o, std::move(*record), how, again, figures);
    }
    progress.clear();
    if (o.json != "-") {
        fmt::print("{} -> {} ({}{})\n", o.record.empty() ? o.volume.string() : o.record, o.output.string(), o.what, more);
    }
    command::writeJson(o.json, figures);
}

}  // namespace

void addExport(CLI::App& app)
{
    const auto o = std::make_shared<ExportArguments>();
    CLI::App* command = app.add_subcommand(
        "export", "Write a volume, or the state of a record at one time, as NIfTI, NRRD, MetaImage, .vtu or .png");
    command->add_option("volume", o->volume, "Volume (.vdb)")->type_name("V.vdb");
    command
        ->add_option("-o,--output", o->output, "File to write: .nii, .nii.gz, .nrrd, .seg.nrrd, .mha, .mhd, .vtu or .png")
        ->type_name("FILE")
        ->required();
    command->add_option("--record", o->record, "Record of a session (train --record), instead of a volume")
        ->type_name("FILE");
    command->add_option("--at", o->at, "Session time of the state, e.g. 3.2s or 3200ms")->type_name("TIME");
    command
        ->add_option("--what", o->what,
                     "Of a volume: labels (default), image, stiffness [kPa]; of a record: labels, displacement (default "
                     "for .vtu), inverse displacement [mm, LPS], ultrasound and ct (one is the default for .png: as the "
                     "scene has it)")
        ->check(CLI::IsMember(whatChoices));
    command->add_flag("--nifti2", o->nifti2, "Write NIfTI-2, with positions in double precision");
    command->add_option("--write-map", o->map, "Also write names and tissues as a label map, for import --map")
        ->type_name("FILE");
    command->add_option("--like", o->like, "Stored ultrasound picture: repeat its time, probe, settings and size")
        ->type_name("FILE.png");
    command::addNumber(*command, "--width", o->width, "Width of an ultrasound picture [pixels]", 100, base::mostSide);
    command::addChoice(*command, "--window", o->window, "Grey-level window of a CT scan", windowChoices);
    command::addNumber(*command, "--height", o->height,
                       "Height of an ultrasound picture, or of a slice of a CT scan [pixels]", 100, base::mostSide);
    command->add_option("--json", o->json, "Write figures to this file (- = standard output)")->type_name("FILE");
    command->final_callback([o, command] { runExport(*command, *o); });
}

}  // namespace palpate::apps
