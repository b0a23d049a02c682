#include <training/case.h>
#include <training/curriculum.h>
#include <training/store.h>

#include <base/error.h>
#include <base/split.h>
#include <datasets/scene_text.h>
#include <haptics/interrupted.h>
#include <haptics/measures.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace palpate::training {

Values valuesOf(const haptics::Score& score)
{
    Values values;
    for (const haptics::Measure& m : haptics::measures()) {
        if (const double value = m.value(score); !std::isnan(value)) {
            values[m.key] = value;
        }
    }
    return values;
}

namespace {

std::optional<std::string> toldIn(const haptics::SessionInfo& info, const char* key)
{
    const auto at = std::ranges::find(info.extra, key, &std::pair<std::string, std::string>::first);
    return at == info.extra.end() ? std::nullopt : std::optional(at->second);
}

// Of a session that counts: refuses others.
haptics::Score scoreOfTried(const haptics::Record& record, const std::string& name)
{
    haptics::Scorer scorer(record.info());
    bool faulted = false;
    record.each([&](const haptics::TickRecord& tick) {
        scorer.add(tick);
        faulted = faulted || tick.faulted;
    });
    base::failIf(faulted, "{}: ended with a fault: a force or a pose was not finite", name);
    haptics::Score score = scorer.score();
    base::failIf(score.skinContacts == 0, "{}: the tool never touched the body: this session does not count", name);
    return score;
}

}  // namespace

double guidanceIn(const haptics::SessionInfo& info)
{
    if (toldIn(info, modeKey) == "test") {
        return 0;
    }
    if (const auto written = toldIn(info, guidanceKey)) {
        return base::numberIn(*written).value_or(1);
    }
    if (info.sceneText.empty()) {
        return 1;
    }
    const auto dffb = datasets::parseRecordedScene(info.sceneText, info.sceneOrigin).dffb;
    return dffb.mode == datasets::DffbMode::off ? 0 : std::min(dffb.gain, 1.0);
}

StoredSession sessionOf(const std::filesystem::path& file)
{
    const haptics::Record record(file);
    const haptics::Seal seal = record.seal();
    base::failIf(seal.state == haptics::Seal::State::open, "{}: was not closed: its session was cut off or still runs",
                 file.native());
    if (seal.state == haptics::Seal::State::broken) {
        throw base::error("{}: was changed after it was closed: {}", file.native(), seal.changed.front());
    }
    const std::string interrupted = record.result(haptics::interruptedKey);
    base::failIf(!interrupted.empty(), "{}: was interrupted ({}): this session does not count", file.native(), interrupted);
    const haptics::SessionInfo& info = record.info();
    StoredSession s;
    s.started = info.started;
    s.scene = info.scene;
    s.device = info.device;
    s.build = info.build;
    s.record = std::filesystem::absolute(file).lexically_normal().string();
    s.recordSha256 = seal.sha256;
    s.taken = true;
    s.values = valuesOf(scoreOfTried(record, file.native()));
    s.caseId = toldIn(info, caseKey).value_or("");
    if (const auto exercise = toldIn(info, exerciseKey)) {
        const std::size_t slash = exercise->find('/');
        s.curriculum = exercise->substr(0, slash);
        s.exercise = slash == std::string::npos ? "" : exercise->substr(slash + 1);
    }
    s.test = toldIn(info, modeKey) == "test";
    s.guidance = guidanceIn(info);
    return s;
}

void declare(StoredSession& s, const Declared& as)
{
    const auto differs = [&s](const std::string& option, const std::string& had, const std::string& now) {
        base::failIf(!had.empty() && had != now, "{}: the record {} says {}", option, s.record, had);
    };
    const auto isOf = [&s](const std::string& option, const Case& wanted) {
        const std::string scene = sceneName(wanted);
        base::failIf(scene != s.scene, "{}: the record {} is of the scene '{}', and this is of '{}'", option, s.record,
                     s.scene, scene);
        s.caseId = wanted.id;
    };
    if (!as.caseId.empty()) {
        const Case wanted = findCase(as.caseId);
        differs("--case " + as.caseId, s.caseId, wanted.id);
        isOf("--case " + as.caseId, wanted);
    }
    if (!as.exercise.empty()) {
        const std::string option = "--exercise " + as.exercise;
        const auto [curriculum, exercise] = findExercise(as.exercise);
        differs(option, s.exercise.empty() ? "" : s.curriculum + "/" + s.exercise, curriculum.id + "/" + exercise);
        const Case wanted = findCase(curriculum.exercise(exercise)->caseId);
        differs(option, s.caseId, wanted.id);
        isOf(option, wanted);
        s.curriculum = curriculum.id;
        s.exercise = exercise;
    }
    base::failIf(as.test && s.guidance > 0, "--test: the record {} is of a session with guidance", s.record);
    s.test = s.test || as.test;
}

}  // namespace palpate::training
