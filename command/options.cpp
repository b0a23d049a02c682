#include <command/options.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <stdexcept>

namespace palpate::command {

void addSetting(CLI::App& command, session::SceneChanges& changes)
{
    command.add_option("--setting", changes.setting, "How fine level elastic is")
        ->check(CLI::IsMember(datasets::elasticSettings()));
}

void addFalconOptions(CLI::App& command, session::FalconOptions& options)
{
    command.add_option("--falcon-firmware", options.firmware,
                       "Firmware of the Novint Falcon, which it loses with its power supply (a file of its maker's)");
    command.add_option("--falcon-grip-g", options.grip, "Mass of the Falcon's grip, which its motors carry [g]")
        ->check(CLI::Range(0.0, 300.0))
        ->capture_default_str();
    command.add_option("--on-unplug", options.onUnplug, "When the Falcon is unplugged: exit, or wait for it")
        ->check(CLI::IsMember({"exit", "wait"}))
        ->capture_default_str();
}

void checkFalconOptions(const CLI::App& command, bool falcon)
{
    for (const char* name : {"--falcon-firmware", "--falcon-grip-g", "--on-unplug"}) {
        if (!falcon && command.count(name) > 0) {
            throw std::runtime_error(fmt::format("{}: goes with --device falcon", name));
        }
    }
}

}  // namespace palpate::command
