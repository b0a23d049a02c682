#include <command/options.h>

#include <base/error.h>
#include <base/split.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

namespace palpate::command {

void addModel(CLI::App& command, session::SceneChanges& changes)
{
    command.add_option("--model", changes.model, "Level of the tissue model (default: as in the scene)")
        ->check(CLI::IsMember(datasets::modelLevels));
}

void addSetting(CLI::App& command, session::SceneChanges& changes)
{
    command
        .add_option("--setting", changes.setting,
                    "Resolution of level elastic (default: as in the scene; if it has none, train fits it to the machine)")
        ->check(CLI::IsMember(datasets::elasticSettings()));
}

std::string seedFault(const std::string& text)
{
    constexpr auto most = std::numeric_limits<std::int64_t>::max();  // that a scene can hold
    const bool digits = text.find_first_not_of("0123456789") == std::string::npos;
    return digits && base::numberIn<std::int64_t>(text)
               ? ""
               : fmt::format("{}: must be a whole number from 0 to {}", text, most);
}

void refuseNoValues(CLI::App& app)
{
    // Without a description, which --help would print behind each option.
    const CLI::Validator filled(
        [](const std::string& value) {
            return value.empty() ? std::string("the value is empty: give one, or leave out the option") : std::string();
        },
        "");
    const CLI::Validator number(
        [](const std::string& value) {
            double read = 0.0;
            const bool none = CLI::detail::lexical_cast(value, read) && std::isnan(read);
            return none ? fmt::format("{}: must be a number", value) : std::string();
        },
        "");
    for (CLI::Option* const option : app.get_options([](const CLI::Option* o) { return !o->get_lnames().empty(); })) {
        if (option->get_expected_min() > 0) {
            option->transform(filled);  // before its other checks
        }
        if (option->get_type_name().find("FLOAT in [") != std::string::npos) {
            option->check(number);
        }
    }
    for (CLI::App* const command : app.get_subcommands([](const CLI::App*) { return true; })) {
        refuseNoValues(*command);
    }
}

std::vector<std::string> argumentsOf(int argc, char** argv)
{
    std::vector<std::string> words;
    for (int i = argc - 1; i > 0; --i) {
        std::string word = argv[i];
        if (word.size() > 3 && word.starts_with("--") && word.find('=') == word.size() - 1) {
            words.emplace_back();
            word.pop_back();
        }
        words.push_back(std::move(word));
    }
    return words;
}

void addFalconOptions(CLI::App& command, session::FalconOptions& options)
{
    command.add_option("--falcon-firmware", options.firmware,
                       "Firmware file of the Novint Falcon, from its maker; the Falcon loses it without power");
    addNumber(command, "--falcon-grip-g", options.grip, "Mass of the Falcon's grip, compensated by its motors [g]", 0.0,
              300.0);
    addChoice(command, "--on-unplug", options.onUnplug, "If the Falcon is unplugged: exit, or wait until it is back",
              {"exit", "wait"});
}

void checkFalconOptions(const CLI::App& command, bool falcon)
{
    for (const char* name : {"--falcon-firmware", "--falcon-grip-g", "--on-unplug"}) {
        base::failIf(!falcon && command.count(name) > 0, "{}: needs --device falcon", name);
    }
}

}  // namespace palpate::command
