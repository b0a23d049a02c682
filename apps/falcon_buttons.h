#pragma once

#include <session/falcon.h>

namespace palpate::apps {

/// Prints a line for each button that is pressed at the grip of a Falcon, without a force, as long as the program that has
/// started this one runs: "ready: ...", "button NAME", and "waiting: ..." where there is no Falcon or it is no longer
/// there.
/// @param options  its firmware, which is loaded where it does not run
void printButtons(const session::FalconOptions& options);

}  // namespace palpate::apps
