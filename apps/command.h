#pragma once

#include <CLI/App.hpp>

namespace palpate::apps {

// Each command lives in its own file, adds itself to the program here, and does its work in CLI11's final callback.
// A command that cannot do what was asked throws std::runtime_error ("FILE: what is wrong and what to do"); main() prints
// it on one line and exits with 1.
void addTrain(CLI::App& app);
void addImport(CLI::App& app);
void addInfo(CLI::App& app);
void addExport(CLI::App& app);
void addScene(CLI::App& app);
void addPhantom(CLI::App& app);
void addReplay(CLI::App& app);
void addScore(CLI::App& app);
void addPlan(CLI::App& app);
void addPress(CLI::App& app);
void addBench(CLI::App& app);
void addDevices(CLI::App& app);
void addCase(CLI::App& app);
void addCurriculum(CLI::App& app);
void addProfile(CLI::App& app);
void addProgress(CLI::App& app);
void addSessions(CLI::App& app);

}  // namespace palpate::apps
