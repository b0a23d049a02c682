#include <trainer/case_entry.h>

#include <base/mapped.h>
#include <base/words.h>
#include <trainer/lists.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>

namespace palpate::trainer {

namespace {

using base::marked;
using base::tr;
using nlohmann::json;

CaseEntry entryOf(const json& one)
{
    CaseEntry c;
    std::vector<std::string> trains, measures;
    read(one, "id", c.id, "title", c.title, "picture", c.picture, "difficulty", c.difficulty, "trains", trains, "measures",
         measures, "briefing", c.steps);
    c.title = tr(c.title);
    const auto translated = [](const std::string& what) { return tr(what); };
    c.trains = fmt::format("{}", fmt::join(base::mapped<std::string>(trains, translated), ", "));
    std::ranges::transform(c.steps, c.steps.begin(), translated);
    c.palpation = std::ranges::find(measures, "mark_error_mm") != measures.end();
    c.core = !c.palpation && std::ranges::none_of(measures, [](const std::string& measure) {
        return measure == "rest_s" || measure == "tip_to_target_mm";
    });
    return c;
}

}  // namespace

const char* difficultyInWords(int difficulty) noexcept
{
    constexpr std::array words{marked("first steps"), marked("easy"), marked("medium"), marked("hard"),
                               marked("very hard")};
    return tr(words[static_cast<std::size_t>(std::clamp(difficulty, 1, 5) - 1)]);
}

std::vector<CaseEntry> casesOf(const json& list)
{
    std::vector<CaseEntry> cases;
    each(list, "cases", [&](const json& one) { cases.push_back(entryOf(one)); });
    std::ranges::stable_sort(cases, {}, &CaseEntry::difficulty);
    return cases;
}

std::vector<PersonEntry> peopleOf(const json& list)
{
    std::vector<PersonEntry> people;
    each(list, "profiles", [&](const json& one) {
        people.push_back({one.at("name").get<std::string>(), one.at("hand") == "left"});
    });
    return people;
}

}  // namespace palpate::trainer
