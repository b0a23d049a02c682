#include <apps/command.h>
#include <apps/parsed_program.h>
#include <apps/version.h>
#include <base/child_process.h>
#include <base/mapped.h>
#include <base/nearest.h>
#include <base/one_line.h>
#include <command/options.h>
#include <studies/commands.h>
#ifdef PALPATE_SWEEP
#include <sweep/command.h>
#endif

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
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
        std::string what = e.what(), command = program->get_name();
        const CLI::App* within = program;  // `palpate case`, for a word behind it
        while (!within->get_subcommands().empty()) {
            within = within->get_subcommands().front();
            command += " " + within->get_name();
        }
        if (e.get_name() == "RequiredError" && !unknown.empty()) {
            const auto commands = palpate::base::mapped<std::string>(within->get_subcommands({}), &CLI::App::get_name);
            what = unknown[0] + ": there is no such command or option" + palpate::base::meant(unknown[0], commands);
        }
        if (what.ends_with("not expected: ")) {
            what += "\"\"; an option that takes no value has no = behind it";
        }
        return "palpate: " + palpate::base::oneLine(what) + " (see " + command + " --help)\n";
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
    command::endOnSignals("palpate");
    command::failOnLargeFiles();
    return exitStatus(app, [&] { app.parse(commandOf(argc, argv)); });
}
