#pragma once

#include <haptics/falcon/driver.h>

#include <memory>
#include <string>

namespace palpate::session {

/// What the command line says about a Novint Falcon.
struct FalconOptions {
    std::string firmware;           // file; empty: it runs already
    std::string onUnplug = "exit";  // what the guardian does: see falcon/guardian.h
    double grip = 100;              // mass that the motors carry [g]
};

/// Tells the user what the Falcon needs: a line on standard error.
void sayForFalcon(const std::string& what);

falcon::LinkOptions linkOptions(const FalconOptions& options);

/// A Falcon that is ready, after its user has homed it. Throws std::runtime_error.
std::shared_ptr<falcon::Driver> openFalcon(const FalconOptions& options);

}  // namespace palpate::session
