#pragma once

#include <session/falcon.h>
#include <session/open.h>

#include <CLI/App.hpp>

#include <initializer_list>
#include <string>
#include <vector>

namespace palpate::command {

/// The option --model of a command.
void addModel(CLI::App& command, session::SceneChanges& changes);
/// The option --setting of a command.
void addSetting(CLI::App& command, session::SceneChanges& changes);

/// An option for a number from `least` to `most`; --help shows its default.
template <typename Value, typename Bound>
CLI::Option* addNumber(CLI::App& app, const std::string& name, Value& value, const std::string& text, Bound least,
                       Bound most)
{
    return app.add_option(name, value, text)->check(CLI::Range(least, most))->capture_default_str();
}
/// An option for one of `choices`; --help shows its default.
template <typename Value, typename Choices = std::initializer_list<const char*>>
CLI::Option* addChoice(CLI::App& app, const std::string& name, Value& value, const std::string& text,
                       const Choices& choices)
{
    return app.add_option(name, value, text)->check(CLI::IsMember(choices))->capture_default_str();
}

/// Empty, or what is wrong with a value of --seed: of a negative or a huge one CLI11 would make another number.
std::string seedFault(const std::string& text);

/// Call after all options have been added, for a program's app: none of them takes an empty value ("--csv ''", a variable
/// of a shell that is not set), but for those that may have none (expected(0, 1)); none with a CLI::Range
/// takes "nan", which is in all of them.
void refuseNoValues(CLI::App& app);

/// The words of a command line, last first as CLI11 takes them. An empty value behind `=` ("--csv=") is a word of its own:
/// CLI11 would take the next word.
std::vector<std::string> argumentsOf(int argc, char** argv);

void addFalconOptions(CLI::App& command, session::FalconOptions& options);
/// Throws std::runtime_error when one of them was given without the Falcon.
void checkFalconOptions(const CLI::App& command, bool falcon);

}  // namespace palpate::command
