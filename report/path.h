#pragma once

#include <report/data.h>

#include <haptics/recorder.h>

#include <string>

namespace palpate::report {

/// The tip's path as drawings (SVG) from the feet, from the left and from the front: outside and inside the body, notches
/// of the cores, marks, and the target at rest. Empty without a path.
std::string pathCard(const ReportData& data, const haptics::SessionInfo& info);

}  // namespace palpate::report
