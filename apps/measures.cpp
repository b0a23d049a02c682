#include <apps/measures.h>

#include <nlohmann/json.hpp>

namespace palpate::apps {

nlohmann::json scoreFigures(const haptics::Score& score)
{
    nlohmann::json out;
    for (const Measure& m : measures()) {
        out[m.key] = m.value(score);
    }
    const haptics::ScoreParts p = haptics::parts(score);
    out["points"] = {{"core", p.core}, {"vital", p.vital}, {"technique", p.technique}};
    return out;
}

}  // namespace palpate::apps
