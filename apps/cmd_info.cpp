#include <apps/command.h>
#include <apps/report/volume.h>
#include <apps/session.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <memory>

namespace palpate::apps {

namespace {

struct InfoOptions {
    std::filesystem::path file, json;
};

void runInfo(const InfoOptions& options)
{
    const volume::Tissue tissue = loadVolume(options.file);
    if (options.json != "-") {
        fmt::print("{}\n\n", options.file.string());
        printVolume(tissue);
    }
    if (!options.json.empty()) {
        writeJson(options.json, volumeFigures(tissue));
    }
}

}  // namespace

void addInfo(CLI::App& app)
{
    const auto options = std::make_shared<InfoOptions>();
    CLI::App* command = app.add_subcommand("info", "Show what a volume holds: size, tissues, memory, where it comes from");
    command->add_option("volume", options->file, "Volume (.vdb)")->type_name("V.vdb")->required();
    command->add_option("--json", options->json, "Write the figures here, - for standard output")->type_name("FILE");
    command->final_callback([options] { runInfo(*options); });
}

}  // namespace palpate::apps
