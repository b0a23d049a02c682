#pragma once

#include <haptics/falcon/driver.h>

#include <CLI/App.hpp>

#include <memory>
#include <string>

namespace palpate::apps {

/// What the command line says about a Novint Falcon.
struct FalconOptions {
    std::string firmware;  // file; empty: it runs already
    std::string onUnplug = "exit";
    double grip = 100;  // mass that the motors carry [g]
};

void addFalconOptions(CLI::App& command, FalconOptions& options);
/// Throws std::runtime_error when one of them was given without the Falcon.
void checkFalconOptions(const CLI::App& command, bool falcon);

/// Tells the user what the Falcon needs: a line on standard error.
void sayForFalcon(const std::string& what);

falcon::LinkOptions linkOptions(const FalconOptions& options);

/// A Falcon that is ready, after its user has homed it. Throws std::runtime_error.
std::shared_ptr<falcon::Driver> openFalcon(const FalconOptions& options);

}  // namespace palpate::apps
