#pragma once

#include <nlohmann/json_fwd.hpp>

#include <optional>
#include <string>
#include <vector>

namespace palpate::trainer {

/// A case as somebody chooses it.
struct CaseEntry {
    std::string id;                  // a word, part of the names of its files; `palpate train --case` takes it
    std::string title;               // "Core biopsy between two vessels"
    std::string picture;             // PNG file
    int difficulty = 1;              // 1 (first steps) to 5
    std::string trains;              // what it is good for, in a line
    std::vector<std::string> steps;  // of its own briefing: stepsOf() has the others
    bool palpation = false;          // with a fingertip
    bool core = true;                // else, and where it is no palpation, no core is asked for
    std::optional<double> best;      // points of the best session so far; nothing: not done yet
};

/// "first steps", "easy", "medium", "hard", "very hard".
const char* difficultyInWords(int difficulty) noexcept;

/// What `palpate case list --json` gives, easiest first. Cases that are not whole are left out.
std::vector<CaseEntry> casesOf(const nlohmann::json& list);

/// Somebody who trains.
struct PersonEntry {
    std::string name;
    bool leftHanded = false;
};

/// Those that `palpate profile list --json` gives.
std::vector<PersonEntry> peopleOf(const nlohmann::json& list);

}  // namespace palpate::trainer
