#pragma once

#include <session/open.h>
#include <session/trainer.h>
#include <training/case.h>
#include <training/curriculum.h>
#include <training/store.h>

#include <CLI/App.hpp>

#include <filesystem>
#include <optional>
#include <string>

namespace palpate::apps {

/// What `palpate train` is told of case, exercise and person.
struct TrainingOptions {
    std::string caseId;    // name or folder
    std::string exercise;  // CURRICULUM/EXERCISE
    std::string profile;
    std::filesystem::path profiles;  // empty: the standard file
    bool test = false;
    std::string hand;  // "right" or "left"; empty: as the profile says
};

/// What became of a session in the profile.
struct Conclusion {
    bool kept = false;
    std::string why;                      // why it is not kept; empty: it is, or there is no profile
    std::vector<std::string> lines;       // there are to say
    std::vector<std::string> measures;    // that the case is about
    std::vector<training::Level> levels;  // of the exercise
};

/// A session that is trained for something: a case, an exercise, a person's progress.
class Training {
public:
    /// Looks everything up. Throws std::runtime_error for what is not there, and for an exercise that is not available yet.
    explicit Training(TrainingOptions options);

    /// The scene to open; empty: none of the options says one.
    std::string scene() const { return case_ ? case_->scene : ""; }
    /// Of the case; empty: there is none.
    std::string title() const { return case_ ? case_->title : ""; }
    /// Guidance of this trial.
    void change(session::SceneChanges& changes) const;
    /// Where the record goes when nobody asked for one; empty: nowhere.
    std::filesystem::path record();
    /// Renames the record of record() where it is not whole, so that nobody takes it for a session: X.db, and its log, to
    /// X-cut-off.db. `record` is its name before and after, and the problem of `result` says it.
    void markCut(session::TrainResult& result, std::string& record) const;
    /// What the record says of it.
    void describe(haptics::SessionInfo& info) const;
    /// Keeps a session that counts in the profile. A profile that cannot be written is added to the problem of `result`.
    /// Its lines have the largest losses of points first.
    Conclusion conclude(const haptics::SessionInfo& info, session::TrainResult& result,
                        const std::filesystem::path& record);
    /// Whether who trains holds needle and mouse in the left hand.
    bool leftHanded() const noexcept;
    const std::string& profile() const noexcept { return options_.profile; }

private:
    Conclusion outcome(const haptics::SessionInfo& info, session::TrainResult& result, const std::filesystem::path& record);
    Conclusion keep(const haptics::SessionInfo& info, const session::SessionFigures& figures,
                    const std::filesystem::path& record);
    // What there is to say where a session is not kept.
    Conclusion notKept(const std::string& why, const std::filesystem::path& record) const;

    TrainingOptions options_;
    std::optional<training::Case> case_;
    std::optional<training::Curriculum> curriculum_;
    const training::Exercise* exercise_ = nullptr;
    std::optional<training::ProfileStore> store_;
    std::optional<training::Person> person_;
    int trial_ = 1;              // of the exercise, from 1 up
    std::filesystem::path own_;  // the record that record() named
};

/// The options of `palpate train`.
void addTrainingOptions(CLI::App& command, TrainingOptions& options);

}  // namespace palpate::apps
