#include <apps/measures.h>

#include <nlohmann/json.hpp>

namespace palpate::apps {

nlohmann::json scoreFigures(const haptics::Score& score)
{
    nlohmann::json out;
    for (const Measure& m : measures()) {
        out[m.key] = m.value(score);
    }
    const haptics::ScoreParts points = haptics::parts(score);
    for (const haptics::PartOfTotal& part : haptics::partsOfTotal) {
        out["points"][part.key] = points.*part.points;
    }
    return out;
}

}  // namespace palpate::apps
