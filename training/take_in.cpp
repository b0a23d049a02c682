#include <training/store.h>

#include <base/error.h>
#include <base/split.h>
#include <haptics/measures.h>

#include <cmath>

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

StoredSession sessionOf(const std::filesystem::path& file)
{
    const haptics::Record record(file);
    const haptics::Seal seal = record.seal();
    base::failIf(seal.state == haptics::Seal::State::open, "{}: was not closed: its session was cut off or still runs",
                 file.native());
    if (seal.state == haptics::Seal::State::broken) {
        throw base::error("{}: was changed after it was closed: {}", file.native(), seal.changed.front());
    }
    const haptics::SessionInfo& info = record.info();
    StoredSession s;
    s.started = info.started;
    s.scene = info.scene;
    s.device = info.device;
    s.build = info.build;
    s.record = std::filesystem::absolute(file).lexically_normal().string();
    s.recordSha256 = seal.sha256;
    s.taken = true;
    s.values = valuesOf(haptics::scoreOf(record));
    for (const auto& [key, value] : info.extra) {
        if (key == caseKey) {
            s.caseId = value;
        } else if (key == exerciseKey) {
            const std::size_t slash = value.find('/');
            s.curriculum = value.substr(0, slash);
            s.exercise = slash == std::string::npos ? "" : value.substr(slash + 1);
        } else if (key == modeKey) {
            s.test = value == "test";
        } else if (key == guidanceKey) {
            s.guidance = base::numberIn(value).value_or(1);
        }
    }
    return s;
}

}  // namespace palpate::training
