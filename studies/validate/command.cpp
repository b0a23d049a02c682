#include <base/inputs.h>
#include <studies/commands.h>

#include <base/error.h>
#include <base/outputs.h>
#include <command/json.h>
#include <command/progress.h>
#include <datasets/tables.h>
#include <haptics/scenery.h>
#include <studies/validate/experiment.h>
#include <studies/validate/figures.h>
#include <studies/validate/measurements.h>
#include <ultrasound/checks.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <memory>

namespace palpate::studies {

using nlohmann::json;

namespace {

constexpr std::array<const char*, 6> allNames{"silicone", "beam", "needle", "relaxation", "palpation", "ultrasound"};

struct ValidateArguments {
    std::vector<std::string> names;
    std::filesystem::path data, tissues, folder, json, csv;
    bool quick = false;
};

struct FolderRun {
    const ValidateArguments& options;
    std::vector<std::filesystem::path> folders;
    command::Progress& progress;
    std::vector<Experiment> experiments;
    std::vector<ultrasound::Check> checks;

    std::filesystem::path data(const char* name) const { return measurementFile(folders, name); }
    void add(std::vector<Experiment> more)
    {
        experiments.insert(experiments.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
    }
    void run(const std::string& name);
    Experiment ultrasoundChecks();
};

Experiment FolderRun::ultrasoundChecks()
{
    const volume::TissueTable table =
        options.tissues.empty() ? datasets::defaultTissues() : datasets::loadTissues(options.tissues);
    const auto soundOf = [&](std::string_view name) {
        const auto row = table.find(name);
        base::failIf(!row, "{}: has no tissue '{}', which the checks need", options.tissues.native(), name);
        return haptics::soundOf(table.rows[*row]);
    };
    checks = ultrasound::runChecks(soundOf, [&](double fraction) { progress.show("ultrasound", fraction); });
    Experiment e;
    e.name = "ultrasound";
    e.quantity = "figures of the picture beside closed forms, the largest difference in what is allowed";
    e.source = "closed forms and published figures, see docs/ultrasound.md";
    e.fittedOn = "nothing";
    e.predicted =
        fmt::format("{} figures: echo levels, attenuation, speckle, point spread, motion, needle, shadows", checks.size());
    e.bound = 100.0;
    e.picture = {"Ultrasound: differences, in what is allowed", "check", "difference over what is allowed [%]", {}};
    ValidateCurve points{"checks", {}, {}, false};
    std::size_t held = 0;
    for (const ultrasound::Check& c : checks) {
        points.add(static_cast<double>(points.x.size() + 1), 1e2 * std::abs(c.measured - c.wanted) / c.tolerance);
        held += c.good() ? 1 : 0;
    }
    const ErrorSummary summary = summaryOf(points.y);
    e.error = e.worst = summary.worst;
    e.note = fmt::format("{} of {} checks hold", held, checks.size());
    e.picture.curves.push_back(std::move(points));
    e.verdict = held == checks.size() ? Verdict::holds : Verdict::fails;
    return e;
}

void FolderRun::run(const std::string& name)
{
    const ValidateProgress tell = [&](const std::string& what) { progress.show(what); };
    if (name == "silicone") {
        add(siliconeCompression(data("silicone_compression_ecoflex.csv"), options.quick, tell));
    } else if (name == "beam") {
        add({siliconeBeam(data("silicone_cantilever_static.csv"), options.quick, tell)});
    } else if (name == "needle") {
        add(needleInLiver(data("needle_liver_human_curves.csv"), data("needle_liver_human_hold_relaxation.csv"), tell));
    } else if (name == "relaxation") {
        add(relaxation(options.quick, tell));
    } else if (name == "palpation") {
        add({palpationOrder(data("literature_facts_read.csv"), tell)});
    } else {
        add({ultrasoundChecks()});
    }
}

void printChecks(const std::vector<ultrasound::Check>& checks)
{
    fmt::print("\n{:<62} {:>9} {:>9} {:>8} {:>8} {:<6}\n", "", "measured", "wanted", "error", "allowed", "");
    for (const ultrasound::Check& c : checks) {
        fmt::print("{:<62} {:>9.3f} {:>9.3f} {:>8.3f} {:>8.3f} {:<6}{}\n", c.what, c.measured, c.wanted,
                   c.measured - c.wanted, c.tolerance, c.unit, c.good() ? "" : " FAILED");
    }
}

json figuresOf(const FolderRun& run)
{
    json figures = experimentsJson(run.experiments);
    if (!run.checks.empty()) {
        figures["checks"] = json::array();
    }
    for (const ultrasound::Check& c : run.checks) {
        figures["checks"].push_back({{"what", c.what},
                                     {"unit", c.unit},
                                     {"measured", c.measured},
                                     {"wanted", c.wanted},
                                     {"tolerance", c.tolerance},
                                     {"source", c.source},
                                     {"good", c.good()}});
    }
    return figures;
}

// Throws when an experiment fails or was not run: the exit status repeats the verdicts.
void checkVerdicts(const std::vector<Experiment>& experiments)
{
    std::vector<std::string> failed, missing;
    for (const Experiment& e : experiments) {
        if (e.verdict != Verdict::holds) {
            (e.verdict == Verdict::fails ? failed : missing).push_back(e.name);
        }
    }
    std::string what = failed.empty() ? ""
                                      : fmt::format("{} of {} experiments fail: {}", failed.size(), experiments.size(),
                                                    fmt::join(failed, ", "));
    if (!missing.empty()) {
        what += fmt::format("{}not run (name the experiments that you want): {}", what.empty() ? "" : "; ",
                            fmt::join(missing, ", "));
    }
    base::failIf(!what.empty(), "validate: {}", what);
}

// Files that an experiment may read.
std::vector<std::filesystem::path> inputsOf(const ValidateArguments& o)
{
    std::vector<std::filesystem::path> inputs{o.tissues};
    for (const auto& folder : measurementFolders(o.data)) {
        std::ranges::move(base::filesWith(".csv", folder), std::back_inserter(inputs));
    }
    return inputs;
}

void validateCommand(const ValidateArguments& o)
{
    base::checkOutputs({o.json, o.csv}, inputsOf(o));
    base::checkOutputFolder(o.folder);
    base::failIf(!o.tissues.empty() && !o.names.empty() && std::ranges::find(o.names, "ultrasound") == o.names.end(),
                 "--tissues: only the experiment ultrasound reads a tissue table: name it too, or leave this out");
    base::failIf(!o.data.empty() && !std::filesystem::is_directory(o.data),
                 "{}: is no folder: name the one with the measurements", o.data.native());
    command::Progress progress(command::Progress::Clock::ticking);
    FolderRun run{o, measurementFolders(o.data), progress, {}, {}};
    for (const char* name : allNames) {
        if (!o.names.empty() && std::ranges::find(o.names, name) == o.names.end()) {
            continue;
        }
        try {
            run.run(name);
        } catch (const NoMeasurement& e) {
            Experiment missing;
            missing.name = name;
            missing.quantity = "not run: its measurements are not there";
            missing.note = e.what();
            run.experiments.push_back(std::move(missing));
        }
    }
    progress.clear();
    const bool toOutput = o.json == "-" || o.csv == "-";
    if (!toOutput) {
        printExperiments(run.experiments);
        if (!run.checks.empty()) {
            printChecks(run.checks);
        }
    }
    if (!o.folder.empty()) {
        writeValidateFolder(o.folder, run.experiments);
    }
    command::writeJson(o.json, figuresOf(run));
    if (o.csv == "-") {
        fmt::print("{}", experimentsCsv(run.experiments));
    } else if (!o.csv.empty()) {
        base::writeWhole(o.csv, experimentsCsv(run.experiments));
    }
    checkVerdicts(run.experiments);
}

}  // namespace

void addValidate(CLI::App& app)
{
    const auto o = std::make_shared<ValidateArguments>();
    auto* validate = app.add_subcommand("validate",
                                        "Compare simulations with measurements, published figures and closed forms; exit "
                                        "status 1 if one fails or cannot be run");
    validate->add_option("experiments", o->names, "Experiments to run (default: all)")
        ->check(CLI::IsMember(std::vector<std::string>(allNames.begin(), allNames.end())));
    validate
        ->add_option("--data", o->data, "Folder of measurements, searched before $PALPATE_MEASURED and the included ones")
        ->type_name("FOLDER");
    validate->add_option("-o,--output", o->folder, "Folder for validation.html, .json, .csv and pictures (PNG)")
        ->type_name("FOLDER");
    validate->add_option("--json", o->json, "Write figures to this file (- = standard output)")->type_name("FILE");
    validate->add_option("--csv", o->csv, "Write a row per experiment to this file (- = standard output)")
        ->type_name("FILE");
    validate->add_option("--tissues", o->tissues, "ultrasound: tissue table to check with (default: the built-in one)")
        ->type_name("FILE");
    validate->add_flag("--quick", o->quick, "Larger cells: a quick preview, not for final figures");
    validate->final_callback([o] { validateCommand(*o); });
}

}  // namespace palpate::studies
