#include <haptics/record_check.h>

#include <base/split.h>
#include <datasets/scene.h>
#include <haptics/replay.h>
#include <haptics/score.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <optional>
#include <ranges>

namespace palpate::haptics {

namespace {

// Where ticks follow one another and where they do not.
class Continuity {
public:
    void add(std::uint64_t tick)
    {
        if (tick != next_) {
            missing_ += tick - next_;
            first_ = first_.value_or(next_);
        }
        next_ = tick + 1;
        ++ticks_;
    }
    std::uint64_t ticks() const noexcept { return ticks_; }
    bool whole() const noexcept { return missing_ == 0; }
    std::string inWords() const
    {
        return missing_ == 0 ? ""
                             : fmt::format(
                                   "{} of {} ticks are missing, the first of them tick {}: measures over time are "
                                   "too small, and nothing can be replayed",
                                   missing_, missing_ + ticks_, *first_);
    }

private:
    std::uint64_t next_ = 0, ticks_ = 0, missing_ = 0;
    std::optional<std::uint64_t> first_;
};

std::string sealInWords(const Seal& seal, int format)
{
    switch (seal.state) {
        case Seal::State::open:
            return "the record is open, its session was cut off or still runs: what there is of it has no seal";
        case Seal::State::absent:
            return fmt::format("a record of format {} has no seal: what has been changed in it does not show", format);
        case Seal::State::broken:
            return "was changed after it was closed: " + someOf(seal.changed);
        case Seal::State::whole:
            break;
    }
    return {};
}

// Ticks that were sent late or left out: the time of those that were left out is in no tick.
std::string missedInWords(const Record& record, std::uint64_t ticks)
{
    constexpr std::uint64_t few = 200;  // one in so many
    const std::uint64_t missed = base::numberIn<std::uint64_t>(record.result("missed_ticks")).value_or(0);
    return missed * few <= ticks
               ? ""
               : fmt::format("{} ticks were missed beside {}: measures over time are too small by up to {:.1f} s", missed,
                             ticks, static_cast<double>(missed) / record.info().rate);
}

// The scene is text in the record, and so is what it was called.
std::string sceneInWords(const SessionInfo& info)
{
    try {
        const datasets::Scene scene = datasets::parseScene(info.sceneText, info.sceneOrigin);
        const auto level = name(scene.model.level);
        if (scene.name != info.scene || level != info.model) {
            return fmt::format("the scene is '{}' with model {}, and '{}' with model {} by its own text", info.scene,
                               info.model, scene.name, level);
        }
    } catch (const std::exception& e) {
        return fmt::format("the scene's text cannot be read ({})", e.what());
    }
    return {};
}

}  // namespace

std::string someOf(const std::vector<std::string>& parts, std::size_t most)
{
    const std::string text = fmt::format("{}", fmt::join(parts | std::views::take(most), "; "));
    return parts.size() > most ? fmt::format("{}; and {} more", text, parts.size() - most) : text;
}

std::string whyItDiffers(const std::filesystem::path& file, std::string_view build)
{
    const Record record(file);
    const std::string made = record.info().build;
    return record.seal().state == Seal::State::broken ? "the record was changed after it was closed"
           : made == build                            ? "the record was made by another machine, or was changed"
                           : fmt::format("the record was made by another build ({}) or machine, or was changed", made);
}

RecordCheck checkRecord(const Record& record, std::string_view build)
{
    RecordCheck check;
    check.seal = record.seal();
    const auto warn = [&check](std::string words) {
        if (!words.empty()) {
            check.warnings.push_back(std::move(words));
        }
    };
    warn(sealInWords(check.seal, record.format()));

    Continuity continuity;
    ForceHash hash;
    Scorer scorer(record.info());
    record.each([&](const TickRecord& tick) {
        continuity.add(tick.tick);
        hash.add(tick);
        scorer.add(tick);
    });
    warn(continuity.inWords());
    warn(missedInWords(record, continuity.ticks()));
    const std::string forces = record.result("force_hash"), now = fmt::format("{:016x}", hash.value());
    if (!forces.empty() && forces != now && continuity.whole()) {
        warn(fmt::format("its forces have the hash {}, and {} at the session's end", now, forces));
    }
    const bool sameBuild = record.info().build == build;
    const std::string total = record.result("score_total"), again = fmt::format("{:.1f}", scorer.score().total);
    if (sameBuild && !total.empty() && total != again) {
        warn(fmt::format("its total is {} by its ticks, and was {} at the session's end", again, total));
    }
    if (!sameBuild) {
        warn(
            fmt::format("was recorded by another build ({}; this is {}): palpate replay says whether its forces are this "
                        "one's too",
                        record.info().build, build));
    }
    warn(sceneInWords(record.info()));
    return check;
}

}  // namespace palpate::haptics
