#include <apps/command.h>
#include <apps/version.h>
#include <base/child_process.h>
#include <base/inputs.h>
#include <base/nearest.h>
#include <command/interrupted.h>
#include <command/options.h>
#include <studies/commands.h>
#ifdef PALPATE_SWEEP
#include <sweep/command.h>
#endif

#include <CLI/CLI.hpp>

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

// `palpate help [COMMAND]` and `palpate version`, as other programs have them.
std::vector<std::string> commandOf(int argc, char** argv)
{
    std::vector<std::string> words = palpate::command::argumentsOf(argc, argv);
    if (!words.empty() && words.back() == "help") {
        words.pop_back();
        words.insert(words.begin(), "--help");
    } else if (!words.empty() && words.back() == "version") {
        words.back() = "--version";
    }
    return words;
}

// `palpate` alone, on a desktop, is the trainer's window. Returns where there is none.
void openTrainer(const char* program)
{
    const auto set = [](const char* name) {
        const char* value = std::getenv(name);
        return value != nullptr && *value != '\0';
    };
    const auto trainer = palpate::base::programFolder() / "palpate-trainer";
    if ((set("DISPLAY") || set("WAYLAND_DISPLAY")) && std::filesystem::exists(trainer)) {
        ::execl(trainer.c_str(), program, static_cast<char*>(nullptr));
    }
}

// What a command printed and nobody got is no success: a full disk behind `>`, a closed pipe.
void checkStandardOutput()
{
    errno = 0;
    if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
        throw std::runtime_error(std::string("standard output: cannot be written") +
                                 (errno != 0 ? std::string(" (") + std::strerror(errno) + ")" : ""));
    }
}

}  // namespace

int main(int argc, char** argv)
{
    if (argc == 1) {
        openTrainer("palpate-trainer");
    }
    CLI::App app("Palpate: feel inside a segmented volume", "palpate");
    app.set_version_flag("--version", palpate::apps::versionText());
    app.require_subcommand(1);
    app.failure_message([](const CLI::App* program, const CLI::Error& e) {
        // CLI11 notices a missing command before a wrong word in its place.
        const auto unknown = program->remaining(true);
        std::string what = e.what();
        if (e.get_name() == "RequiredError" && !unknown.empty()) {
            const CLI::App* within = program;  // `palpate case`, for a word behind it
            while (!within->get_subcommands().empty()) {
                within = within->get_subcommands().front();
            }
            std::vector<std::string> commands;
            for (const CLI::App* command : within->get_subcommands({})) {
                commands.push_back(command->get_name());
            }
            const std::string meant = palpate::base::nearest(unknown[0], commands);
            what = unknown[0] + ": there is no such command or option" +
                   (meant.empty() ? "" : "; did you mean " + meant + "?");
        }
        if (what.ends_with("not expected: ")) {
            what += "\"\"; an option that takes no value has no = behind it";
        }
        return "palpate: " + what + " (see palpate --help)\n";
    });

    using namespace palpate;
    using namespace palpate::apps;
    addTrain(app);
    addCase(app);
    addCurriculum(app);
    addProfile(app);
    addProgress(app);
    addSessions(app);
    addImport(app);
    addInfo(app);
    addExport(app);
    addScene(app);
    addPhantom(app);
    addReplay(app);
    addScore(app);
    addPlan(app);
    addPress(app);
    addBench(app);
    addDevices(app);
    studies::addAccuracy(app);
    studies::addStability(app);
    studies::addValidate(app);
#ifdef PALPATE_SWEEP
    sweep::addSweep(app);
#endif

    command::refuseNoValues(app);
    command::endOnSignals();
    command::failOnLargeFiles();
    try {
        app.parse(commandOf(argc, argv));
        checkStandardOutput();
        return 0;
    } catch (const CLI::ParseError& e) {
        const int status = app.exit(e);
        return status == 0 ? 0 : 2;
    } catch (const command::Interrupted& e) {
        std::fprintf(stderr, "palpate: %s\n", e.what());
        return e.exitStatus();
    } catch (const std::filesystem::filesystem_error& e) {
        std::fprintf(stderr, "palpate: %s\n", palpate::base::inWords(e).c_str());
        return 1;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "palpate: %s\n", e.what());
        return 1;
    }
}
