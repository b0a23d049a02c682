#include <apps/command.h>
#include <base/outputs.h>
#include <command/json.h>
#include <command/progress.h>
#include <datasets/tables.h>
#include <haptics/scenery.h>
#include <ultrasound/checks.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace palpate::apps {

namespace {

struct Options {
    std::filesystem::path tissues, json;
};

void printChecks(const std::vector<ultrasound::Check>& checks)
{
    fmt::print("{:<62} {:>9} {:>9} {:>8} {:>8} {:<6}\n", "", "measured", "wanted", "error", "allowed", "");
    for (const ultrasound::Check& c : checks) {
        fmt::print("{:<62} {:>9.3f} {:>9.3f} {:>8.3f} {:>8.3f} {:<6}{}\n", c.what, c.measured, c.wanted,
                   c.measured - c.wanted, c.tolerance, c.unit, c.good() ? "" : " FAILED");
    }
}

nlohmann::json figures(const std::vector<ultrasound::Check>& checks)
{
    auto all = nlohmann::json::array();
    for (const ultrasound::Check& c : checks) {
        all.push_back({{"what", c.what},
                       {"unit", c.unit},
                       {"measured", c.measured},
                       {"wanted", c.wanted},
                       {"tolerance", c.tolerance},
                       {"source", c.source},
                       {"good", c.good()}});
    }
    return {{"checks", all}};
}

void validateUltrasound(const Options& o)
{
    base::checkOutput(o.json);
    const volume::TissueTable table = o.tissues.empty() ? datasets::defaultTissues() : datasets::loadTissues(o.tissues);
    const auto soundOf = [&](std::string_view name) {
        const auto row = table.find(name);
        if (!row) {
            throw std::runtime_error(
                fmt::format("{}: has no tissue '{}', which the checks need", o.tissues.string(), name));
        }
        return haptics::soundOf(table.rows[*row]);
    };
    command::Progress progress(command::Progress::Clock::ticking);
    const auto checks = ultrasound::runChecks(soundOf, [&](double share) { progress.show("checking", share); });
    progress.clear();
    const auto failed = std::ranges::count_if(checks, [](const auto& c) { return !c.good(); });
    if (o.json != "-") {
        printChecks(checks);
        fmt::print("{} of {} checks hold\n", checks.size() - static_cast<std::size_t>(failed), checks.size());
    }
    if (!o.json.empty()) {
        command::writeJson(o.json, figures(checks));
    }
    if (failed > 0) {
        throw std::runtime_error(fmt::format("validate ultrasound: {} of {} checks failed", failed, checks.size()));
    }
}

}  // namespace

void addValidate(CLI::App& app)
{
    CLI::App* validate =
        app.add_subcommand("validate", "Compare what is simulated with closed forms and published figures");
    validate->require_subcommand(1);
    const auto o = std::make_shared<Options>();
    CLI::App* us = validate->add_subcommand(
        "ultrasound",
        "Echo levels, attenuation, speckle, point spread, motion, needle and shadows of the ultrasound picture");
    us->add_option("--tissues", o->tissues, "Tissue table to check with (default: the built-in one)")->type_name("FILE");
    us->add_option("--json", o->json, "Write the figures here, - for standard output")->type_name("FILE");
    us->final_callback([o] { validateUltrasound(*o); });
}

}  // namespace palpate::apps
