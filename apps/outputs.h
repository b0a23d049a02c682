#pragma once

#include <filesystem>

namespace palpate::apps {

/// Checks before the work begins that it will be possible to write `file` ("" = not asked for, "-" = standard output).
/// Throws std::runtime_error ("FILE: what is wrong and what to do").
void checkOutput(const std::filesystem::path& file);

/// As checkOutput() for a folder that is made, with those above it, when it is not there.
void checkOutputFolder(const std::filesystem::path& folder);

}  // namespace palpate::apps
