#pragma once

#include <apps/no_thread.h>
#include <base/build.h>
#include <base/error.h>
#include <base/inputs.h>
#include <base/one_line.h>
#include <command/interrupted.h>
#include <command/options.h>

#include <CLI/CLI.hpp>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>
#include <string>
#include <system_error>

namespace palpate::apps {

/// What a program printed and nobody got is no success: a full disk behind `>`, a closed pipe. Throws.
inline void checkStandardOutput()
{
    errno = 0;
    if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
        throw base::error("standard output: cannot be written{}",
                          errno != 0 ? std::string(" (") + std::strerror(errno) + ")" : "");
    }
}

/// Does the work of a program, and says what it throws in one line on standard error, also where a name in it has several.
/// Returns the exit status: 0, 1 for what was thrown, 2 for arguments, 128 + signal for what a signal has ended.
template <typename Work>
int exitStatus(const CLI::App& app, const Work& work)
{
    const auto say = [&](const std::string& what) {
        std::fprintf(stderr, "%s: %s\n", app.get_name().c_str(), base::oneLine(what).c_str());
    };
    try {
        try {
            work();
        } catch (const CLI::ParseError& e) {
            if (app.exit(e) != 0) {
                return 2;
            }
        }
        checkStandardOutput();
        return 0;
    } catch (const command::Interrupted& e) {
        say(e.what());
        return e.exitStatus();
    } catch (const std::filesystem::filesystem_error& e) {
        say(base::inWords(e));
    } catch (const std::system_error& e) {
        const char* const what = noThread(e);
        say(what != nullptr ? what : e.what());
    } catch (const std::exception& e) {
        say(e.what());
    }
    return 1;
}

/// A program with one command: parses its arguments and runs it, with exitStatus().
/// @param name   of the program
/// @param about  what --help says of it
/// @param add    adds its options to the app that it gets
/// @param run    does the work, and throws what is wrong
template <typename Add, typename Run>
int runParsed(int argc, char** argv, const std::string& name, const std::string& about, const Add& add, const Run& run)
{
    CLI::App app(about, name);
    app.set_version_flag("--version", std::string(base::build()));
    app.failure_message([&](const CLI::App*, const CLI::Error& e) {
        return name + ": " + base::oneLine(e.what()) + " (see " + name + " --help)\n";
    });
    add(app);
    command::refuseNoValues(app);
    command::failOnLargeFiles();
    return exitStatus(app, [&] {
        app.parse(command::argumentsOf(argc, argv));
        run();
    });
}

}  // namespace palpate::apps
