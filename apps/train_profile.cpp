#include <apps/train_profile.h>

#include <base/counted.h>
#include <base/error.h>
#include <base/outputs.h>
#include <base/told_losses.h>
#include <base/user_files.h>
#include <base/utc.h>
#include <base/words.h>
#include <training/progress.h>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <unistd.h>

#include <algorithm>
#include <ctime>
#include <stdexcept>

namespace palpate::apps {

namespace fs = std::filesystem;

Training::Training(TrainingOptions options) : options_(std::move(options))
{
    if (!options_.profile.empty()) {
        store_.emplace(options_.profiles);
        person_ = store_->find(options_.profile);
    } else if (!options_.profiles.empty()) {
        throw base::error("--profiles: needs a profile: add --profile NAME");
    }
    if (!options_.exercise.empty()) {
        auto [curriculum, exercise] = training::findExercise(options_.exercise);
        curriculum_ = std::move(curriculum);
        exercise_ = curriculum_->exercise(exercise);
        base::failIf(!options_.caseId.empty(), "--case: --exercise has a case of its own: leave out one of them");
        case_ = training::findCase(exercise_->caseId);
    } else if (!options_.caseId.empty()) {
        case_ = training::findCase(options_.caseId);
    }
    if (exercise_ != nullptr && person_) {
        const auto progress = training::progressOf(*curriculum_, store_->sessions(*person_), base::utc());
        const auto here = std::ranges::find(progress.exercises, exercise_, &training::ExerciseProgress::exercise);
        if (!here->available) {
            const auto* const next = progress.next();
            throw base::error("--exercise {}: is still locked for {}{}", options_.exercise, person_->name,
                              next ? "; next is " + curriculum_->id + "/" + next->exercise->id : "");
        }
        trial_ = static_cast<int>(here->sessions.size()) + 1;
    }
}

bool Training::leftHanded() const noexcept
{
    return options_.hand.empty() ? person_ && person_->hand == training::Hand::left : options_.hand == "left";
}

void Training::change(session::SceneChanges& changes) const
{
    base::failIf(changes.dffb && (options_.test || exercise_ != nullptr), "{}",
                 options_.test ? "--dffb: a test is without guidance: leave it out"
                               : "--dffb: the exercise says how much guidance there is: leave it out");
    if (changes.dffb) {
        return;  // the user says it
    }
    if (options_.test) {
        changes.dffb = "off";
    } else if (exercise_ != nullptr && exercise_->guidance == training::Guidance::off) {
        changes.dffb = "off";
    } else if (exercise_ != nullptr && exercise_->guidance == training::Guidance::fade) {
        changes.dffb = "fade";
        changes.trial = fmt::format("{}/{}", std::min(trial_, exercise_->fadeTrials), exercise_->fadeTrials);
    }
}

fs::path Training::record()
{
    if (!store_) {
        return {};
    }
    const fs::path folder = store_->recordFolder();
    if (base::makeFolders(folder)) {
        fs::permissions(folder, fs::perms::owner_all);
    }
    own_ = folder / fmt::format("{:%Y%m%d-%H%M%S}-{}-{}.db", fmt::gmtime(std::time(nullptr)), case_ ? case_->id : "session",
                                ::getpid());
    return own_;
}

void Training::markCut(session::TrainResult& result, std::string& record) const
{
    if (!result.recordCut || own_.empty() || own_ != record) {
        return;
    }
    const fs::path marked = own_.parent_path() / (own_.stem().string() + "-cut-off.db");
    std::error_code failed;
    fs::rename(own_, marked, failed);
    if (failed) {
        return;
    }
    for (const char* log : {"-wal", "-shm"}) {
        fs::rename(own_.string() + log, marked.string() + log, failed);  // not there where all is in the record itself
    }
    const fs::path images = base::imagesBeside(own_);
    fs::rename(images, base::imagesBeside(marked), failed);  // there may be none
    record = marked.string();
    result.problem += "; its name is now " + record;
}

void Training::describe(haptics::SessionInfo& info) const
{
    if (person_ && info.operatorName.empty()) {
        info.operatorName = person_->name;
    }
    if (person_ || !options_.hand.empty()) {
        info.extra.emplace_back(training::handKey, leftHanded() ? "left" : "right");
    }
    if (case_) {
        info.extra.emplace_back(training::caseKey, case_->id);
    }
    if (exercise_ != nullptr) {
        info.extra.emplace_back(training::exerciseKey, curriculum_->id + "/" + exercise_->id);
        info.extra.emplace_back(training::guidanceKey,
                                fmt::format("{:g}", training::guidanceOf(*exercise_, trial_, options_.test)));
    }
    if (case_ || options_.test) {
        info.extra.emplace_back(training::modeKey, options_.test ? "test" : "practice");
    }
}

Conclusion Training::keep(const haptics::SessionInfo& info, const session::SessionFigures& figures, const fs::path& record)
{
    // Somebody who looked and left has not tried.
    if (figures.contacts == 0) {
        const std::string why = "the tool never touched the body";
        return {false,
                person_ ? why : "",
                {fmt::format("{}: this session does not count{}", why, person_ ? " and is not kept" : "")},
                {},
                {}};
    }
    const base::English terminal;  // also where the window has another language
    constexpr std::size_t shown = 3;
    std::vector<std::string> lines;
    const std::vector<haptics::Loss>& losses = figures.lossesInEnglish;
    for (std::size_t i = 0; i < std::min(shown, losses.size()); ++i) {
        if (losses[i].points > base::toldPoints) {
            lines.push_back(haptics::inWords(losses[i]));
        }
    }
    const training::Values values = training::valuesOf(figures.score);
    if (exercise_ != nullptr) {
        lines.push_back(fmt::format("{}: this session {} its level", exercise_->title,
                                    training::meets(exercise_->gate, values) ? "reached" : "did not reach"));
    }
    if (!person_) {
        return {false, "", lines, {}, {}};
    }
    training::StoredSession s;
    s.started = info.started;
    s.caseId = case_ ? case_->id : "";
    s.curriculum = curriculum_ ? curriculum_->id : "";
    s.exercise = exercise_ != nullptr ? exercise_->id : "";
    s.test = options_.test;
    s.guidance = training::guidanceIn(info);
    s.scene = info.scene;
    s.device = info.device;
    s.build = info.build;
    s.values = values;
    if (!record.empty()) {
        s.record = fs::absolute(record).lexically_normal().string();
        s.recordSha256 = haptics::Record(record).seal().sha256;
    }
    const auto id = store_->store(*person_, s);
    lines.push_back(fmt::format("kept for {} as session {} ({} so far)", person_->name, id,
                                base::counted(store_->sessions(*person_).size(), "session")));
    if (curriculum_) {
        const auto progress = training::progressOf(*curriculum_, store_->sessions(*person_), base::utc());
        const auto* const next = progress.next();
        lines.push_back(next == nullptr ? "all exercises are reached"
                                        : fmt::format("{} {}", next->exercise->title, training::reasonFor(*next)));
    }
    return {true, "", lines, {}, {}};
}

Conclusion Training::notKept(const std::string& why, const fs::path& record) const
{
    if (!person_) {
        return {};
    }
    return {false,
            why,
            {fmt::format("not kept for {}: {}{}", person_->name, why,
                         record.empty() ? "" : "; palpate profile add-record adds its record")},
            {},
            {}};
}

// A session without its record cannot be scored or replayed again, so it would count as what nobody can check.
Conclusion Training::outcome(const haptics::SessionInfo& info, session::TrainResult& result, const fs::path& record)
{
    if (result.recordCut) {
        return notKept("the record of the session is not whole", {});
    }
    if (result.signal != 0 || result.faulted) {
        return notKept(result.signal != 0 ? "the session was interrupted" : "the session ended with a fault", {});
    }
    try {
        return keep(info, result, record);
    } catch (const std::runtime_error& e) {
        result.problem += (result.problem.empty() ? "" : "; ") + std::string(e.what());
        return notKept("the profile could not be written", record);
    }
}

Conclusion Training::conclude(const haptics::SessionInfo& info, session::TrainResult& result, const fs::path& record)
{
    Conclusion conclusion = outcome(info, result, record);
    conclusion.measures = case_ ? case_->measures : std::vector<std::string>();
    conclusion.levels = exercise_ != nullptr ? exercise_->gate.levels : std::vector<training::Level>();
    return conclusion;
}

void addTrainingOptions(CLI::App& command, TrainingOptions& o)
{
    command.add_option("--case", o.caseId, "Case to train, by name or folder (palpate case list)");
    command.add_option("--exercise", o.exercise,
                       "Exercise as CURRICULUM/EXERCISE; it sets case and guidance (palpate curriculum list)");
    command.add_option("--profile", o.profile, "Profile in which the session counts (palpate profile new)");
    command.add_option("--profiles", o.profiles, "File of profiles (default: ~/.local/share/palpate/profiles.db)");
    command
        .add_option("--hand", o.hand,
                    "Hand that holds the mouse; left swaps its buttons (default: as in the profile, or right)")
        ->check(CLI::IsMember({"right", "left"}));
    command.add_flag("--test", o.test, "Test: no guidance; counts for gates that require tests");
}

}  // namespace palpate::apps
