#pragma once

#include <optional>
#include <string>
#include <vector>

namespace palpate::trainer {

/// A case as somebody chooses it.
struct CaseEntry {
    std::string id;                      // a word, part of the names of its files
    std::string title;                   // "Core biopsy between two vessels"
    std::string picture;                 // PNG file, or name of a picture that comes with the program
    int difficulty = 1;                  // 1 (first steps) to 5
    std::string trains;                  // what it is good for, in a sentence
    std::vector<std::string> steps;      // of the briefing
    std::vector<std::string> arguments;  // that `palpate train` takes for it
    bool palpation = false;              // with a fingertip
    std::optional<double> best;          // points of the best session so far; nothing: not done yet
};

/// "first steps", "easy", "medium", "hard", "very hard".
const char* difficultyInWords(int difficulty) noexcept;

/// The cases that come with the program, easiest first.
std::vector<CaseEntry> builtInCases();

}  // namespace palpate::trainer
