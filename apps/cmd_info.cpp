#include <apps/command.h>
#include <command/json.h>
#include <report/volume.h>
#include <session/open.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <memory>

namespace palpate::apps {

namespace {

struct InfoArguments {
    std::filesystem::path file, json;
};

void runInfo(const InfoArguments& options)
{
    const volume::Tissue tissue = session::loadVolume(options.file);
    if (options.json != "-") {
        fmt::print("{}\n\n", options.file.string());
        report::printVolume(tissue);
    }
    command::writeJson(options.json, report::volumeFigures(tissue));
}

}  // namespace

void addInfo(CLI::App& app)
{
    const auto options = std::make_shared<InfoArguments>();
    CLI::App* command = app.add_subcommand("info", "Show size, tissues, memory and origin of a volume");
    command->add_option("volume", options->file, "Volume (.vdb)")->type_name("V.vdb")->required();
    command->add_option("--json", options->json, "Write figures to this file (- = standard output)")->type_name("FILE");
    command->final_callback([options] { runInfo(*options); });
}

}  // namespace palpate::apps
