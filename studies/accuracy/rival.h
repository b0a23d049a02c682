#pragma once

#include <studies/accuracy/accuracy.h>

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace palpate::studies {

/// A solver that others wrote, as a program that reads a push from a folder and writes its answer there.
struct Rival {
    std::string name;              // in table and chart
    std::string command;           // a line for the shell; the folder is put behind it
    std::string setting;           // beside the mesh's spacing: "explicit, 0.1 ms"
    std::vector<double> spacings;  // of the meshes that it gets [m]
};

/// Of `COMMAND` or `NAME=COMMAND`. Without a name it is that of the last file in the command, or of its first word, without
/// folder and ending.
/// @param spacings  of the meshes [m]
/// Throws std::runtime_error ("--rival TEXT: what is wrong") for an empty command, and for a name that is not of letters,
/// digits, '_', '-', '.'.
Rival rivalOf(const std::string& text, const std::vector<double>& spacings);

/// What makes an answer of before worthless: another command, or a file in it that has changed since.
std::string fingerprint(const Rival& rival);

/// The setting of a rival on one of its meshes: "4 mm, explicit".
std::string settingOf(const Rival& rival, double spacing);

/// Writes the push, runs the command and compares its answer with the references. Whatever goes wrong with the rival is the
/// run's failure, on one line.
/// @param spacing      of the mesh [m]
/// @param scene        the scene's name
/// @param references   of the subject's path and speed
/// @param folder       is made, and holds push, answer and log.txt, the command's standard output and error
/// @param maxSeconds  for the command to end [s]
AccuracyRun runRival(const Rival& rival, double spacing, const std::string& scene, const AccuracySubject& subject,
                     std::span<const Reference* const> references, const std::filesystem::path& folder, double maxSeconds);

}  // namespace palpate::studies
