#pragma once

#include <training/cusum.h>
#include <training/gate.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace palpate::training {

/// How much of the guiding force an exercise gives in practice; a test gives none.
enum class Guidance : std::uint8_t { on, off, fade };

/// One exercise of a curriculum.
struct Exercise {
    std::string id;
    std::string title;
    std::string caseId;
    std::vector<std::string> after;  // exercises whose gates have to be open; the one before where the file says nothing
    Guidance guidance = Guidance::fade;
    int fadeTrials = 5;  // fade: all of it in the first session, none from this one on
    Gate gate;
};

/// A way from the first touch to proficiency.
struct Curriculum {
    std::string id;  // name of the file without its ending
    std::filesystem::path file;
    std::string title, about;
    double refreshDays = 90;  // an exercise that was not practised for so long is to be refreshed
    CusumPlan cusum;          // a session that does not meet its exercise's levels has failed
    std::vector<Exercise> exercises;

    /// Null where there is none.
    const Exercise* exercise(std::string_view called) const noexcept;
};

/// Reads a curriculum. Throws std::runtime_error ("FILE:LINE: [[exercise]] pass = 6: must be 1 to 5"): also for cases and
/// measures that are not there, levels that nothing can meet, and exercises that wait for one another.
Curriculum loadCurriculum(const std::filesystem::path& file);

/// What is wrong with a curriculum beyond what loadCurriculum() refuses, a line each: measures that an exercise's case
/// never gives. Reads the scenes of its cases.
std::vector<std::string> faultsOf(const Curriculum& curriculum);

/// Those of the user and those that come along, by title; `faults` gets the errors of those that cannot be read.
std::vector<Curriculum> allCurricula(std::vector<std::string>* faults = nullptr);

/// The curriculum called so, or in that file. Throws std::runtime_error, with the nearest name that there is.
Curriculum findCurriculum(const std::string& id);

/// What findCurriculum() takes for this one from any folder: its name, or its file where that name means no file or
/// another.
std::string nameToFind(const Curriculum& curriculum);

/// The curriculum that "CURRICULUM/EXERCISE" names, as findCurriculum() does, and the id of the exercise, which it has.
/// Throws std::runtime_error where it has none.
std::pair<Curriculum, std::string> findExercise(const std::string& named);

/// "total", and the measures that the levels of its gate ask for.
std::vector<std::string> measuresOf(const Exercise& exercise);
/// The fraction of guidance in trial `number` (from 1 up) of an exercise: 1 all, 0 none.
double guidanceOf(const Exercise& exercise, int number, bool test) noexcept;

}  // namespace palpate::training
