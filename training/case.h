#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::training {

/// A case: what a trainee is given. A folder with case.toml and what it names (docs/scenes.md).
struct Case {
    std::string id;                // name of the folder
    std::filesystem::path folder;  // absolute
    std::string title;
    std::string scene;                  // as session::openSession() takes it: a built-in scene, or a file's whole path
    std::filesystem::path picture;      // PNG; empty: none
    std::vector<std::string> briefing;  // the task in steps, a sentence each
    std::vector<std::string> trains;    // what it trains, a few words each
    std::vector<std::string> measures;  // keys of haptics::measures() that matter in it
    int difficulty = 1;                 // 1 to 5
    std::string licence;                // of the case and its volume
    std::string source;                 // who made it, and from what; may be empty
};

inline constexpr std::string_view caseFile = "case.toml";
inline constexpr int hardest = 5;

/// Reads a case. `folder` may be the case's file too.
/// Throws std::runtime_error: "FILE:LINE: difficulty = 9: must be 1 to 5", and for files that the case names and that are
/// not there.
Case loadCase(const std::filesystem::path& folder);

/// All cases in the user's folder and among those that come along, by difficulty, then title. One of the user's hides one
/// of the same name that came along. A case that cannot be read is left out; `faults` gets its error.
std::vector<Case> allCases(std::vector<std::string>* faults = nullptr);

/// The case called `id`, or the one in that folder. Throws std::runtime_error, with the nearest name that there is.
Case findCase(const std::string& id);

/// Whether `what` is a folder with a case in it.
bool isCaseFolder(const std::filesystem::path& what);

/// The name of a case's scene, as its sessions have it. Throws std::runtime_error for a scene that cannot be read.
std::string sceneName(const Case& of);

/// Empty, or why sessions of a case never have this measure (a key of haptics::measures()). Reads the case's scene alone.
/// Throws std::runtime_error for a scene that cannot be read.
std::string measureFault(const Case& of, const std::string& measure);

/// What is wrong with a case beyond what loadCase() refuses, a line each, as for its errors. Builds its session: seconds.
std::vector<std::string> faultsOf(const Case& made);

/// What a new case is made of.
struct NewCase {
    std::filesystem::path volume;  // .vdb
    std::filesystem::path folder;  // that is made; must not be there
    std::string title;             // empty: of the volume's name
    std::string target;            // structure; empty: the volume's first tumour, else the structure nearest its middle
    std::string licence = "not stated: ask who made the volume";
    int difficulty = 3;
};

/// Makes a case of a volume: copies the volume, plans a way in, writes scene.toml and case.toml. Appears whole or not at
/// all. Throws std::runtime_error. @returns the case
Case makeCase(const NewCase& wanted);

/// Names a picture in a case's case.toml, which stays as it is but for that line at its beginning.
/// @param made     a case without a picture
/// @param picture  name of a PNG file in the case's folder
/// Throws std::runtime_error.
void namePicture(const Case& made, const std::string& picture);

}  // namespace palpate::training
