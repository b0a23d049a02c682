#pragma once

#include <base/build.h>
#include <base/inputs.h>
#include <command/interrupted.h>
#include <command/options.h>

#include <CLI/CLI.hpp>

#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>

namespace palpate::apps {

/// A program with one command: parses its arguments and runs it. What is wrong is one line on standard error.
/// @param name   of the program
/// @param about  what --help says of it
/// @param add    adds its options to the app that it gets
/// @param run    does the work, and throws what is wrong
/// Returns the exit status: 0, 1 for what was thrown, 2 for arguments, 128 + signal for what a signal has ended.
template <typename Add, typename Run>
int runParsed(int argc, char** argv, const std::string& name, const std::string& about, const Add& add, const Run& run)
{
    CLI::App app(about, name);
    app.set_version_flag("--version", std::string(base::build()));
    app.failure_message(
        [&](const CLI::App*, const CLI::Error& e) { return name + ": " + e.what() + " (see " + name + " --help)\n"; });
    add(app);
    command::refuseNoValues(app);
    command::failOnLargeFiles();
    try {
        app.parse(command::argumentsOf(argc, argv));
        run();
        return 0;
    } catch (const CLI::ParseError& e) {
        const int status = app.exit(e);
        return status == 0 ? 0 : 2;
    } catch (const command::Interrupted& e) {
        std::fprintf(stderr, "%s: %s\n", name.c_str(), e.what());
        return e.exitStatus();
    } catch (const std::filesystem::filesystem_error& e) {
        std::fprintf(stderr, "%s: %s\n", name.c_str(), base::inWords(e).c_str());
        return 1;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "%s: %s\n", name.c_str(), e.what());
        return 1;
    }
}

}  // namespace palpate::apps
