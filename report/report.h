#pragma once

#include <haptics/recorder.h>

#include <filesystem>

namespace palpate::report {

/// Checks before anything is written that the folder of pictures can be read; "" is none. Throws std::runtime_error.
void checkPictures(const std::filesystem::path& folder);

/// Writes one HTML file about a session that needs nothing else and no network: outcome, score, cores, forces, distances,
/// timing, scene and build.
///
/// @param pictures  a folder of which the PNG files of events and some others are put in, in the order of time; or empty
/// @param file      of the record, so that the page says how to play it again; may be empty
///
/// The file appears whole or not at all; one that is there is replaced. Throws std::runtime_error.
void writeReport(const std::filesystem::path& html, const haptics::Record& record,
                 const std::filesystem::path& pictures = {}, const std::filesystem::path& file = {});

}  // namespace palpate::report
