#include <apps/command.h>
#include <base/build.h>
#include <command/interrupted.h>
#include <studies/accuracy/command.h>
#include <studies/stability/command.h>
#include <sweep/command.h>

#include <CLI/CLI.hpp>

#include <cstdio>
#include <exception>
#include <string>

int main(int argc, char** argv)
{
    CLI::App app("Palpate: feel inside a segmented volume", "palpate");
    app.set_version_flag("--version", std::string(palpate::base::build()));
    app.require_subcommand(1);
    app.failure_message([](const CLI::App* program, const CLI::Error& e) {
        // CLI11 notices a missing command before a wrong word in its place.
        const auto unknown = program->remaining(true);
        const std::string what = e.get_name() == "RequiredError" && !unknown.empty()
                                     ? unknown[0] + ": there is no such command or option"
                                     : e.what();
        return "palpate: " + what + " (palpate --help lists what there is)\n";
    });

    using namespace palpate;
    using namespace palpate::apps;
    addTrain(app);
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
    sweep::addSweep(app);

    try {
        app.parse(argc, argv);
        return 0;
    } catch (const CLI::ParseError& e) {
        const int status = app.exit(e);
        return status == 0 ? 0 : 2;
    } catch (const command::Interrupted& e) {
        std::fprintf(stderr, "palpate: %s\n", e.what());
        return e.exitStatus();
    } catch (const std::exception& e) {
        std::fprintf(stderr, "palpate: %s\n", e.what());
        return 1;
    }
}
