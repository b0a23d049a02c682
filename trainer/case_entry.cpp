#include <trainer/case_entry.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>

namespace palpate::trainer {

namespace {

using nlohmann::json;

// Calls `take` for each member of the list under `key`; what is not as it should be is left out.
template <typename Take>
void each(const json& list, const char* key, const Take& take)
{
    const auto found = list.is_object() ? list.find(key) : list.end();
    if (!list.is_object() || found == list.end() || !found->is_array()) {
        return;
    }
    for (const json& one : *found) {
        try {
            take(one);
        } catch (const json::exception&) {
            continue;
        }
    }
}

CaseEntry entryOf(const json& one)
{
    CaseEntry c;
    c.id = one.at("id").get<std::string>();
    c.title = one.at("title").get<std::string>();
    c.picture = one.at("picture").get<std::string>();
    c.difficulty = one.at("difficulty").get<int>();
    c.trains = fmt::format("{}", fmt::join(one.at("trains").get<std::vector<std::string>>(), ", "));
    const auto measures = one.at("measures").get<std::vector<std::string>>();
    c.palpation = std::ranges::find(measures, "mark_error_mm") != measures.end();
    c.steps.push_back(c.palpation
                          ? "Hold the left mouse button in the picture: you hold the fingertip. The wheel presses."
                          : "Hold the left mouse button in the picture: you hold the needle. The wheel moves it along "
                            "itself, 1 mm a notch; Space fires.");
    for (const std::string& step : one.at("briefing").get<std::vector<std::string>>()) {
        c.steps.push_back(step);
    }
    c.steps.push_back(c.palpation ? "M marks, E ends the session." : "E ends the session.");
    return c;
}

}  // namespace

const char* difficultyInWords(int difficulty) noexcept
{
    constexpr std::array words{"first steps", "easy", "medium", "hard", "very hard"};
    return words[static_cast<std::size_t>(std::clamp(difficulty, 1, 5) - 1)];
}

std::vector<CaseEntry> casesOf(const json& list)
{
    std::vector<CaseEntry> cases;
    each(list, "cases", [&](const json& one) { cases.push_back(entryOf(one)); });
    std::ranges::stable_sort(cases, {}, &CaseEntry::difficulty);
    return cases;
}

std::vector<std::string> peopleOf(const json& list)
{
    std::vector<std::string> people;
    each(list, "profiles", [&](const json& one) { people.push_back(one.at("name").get<std::string>()); });
    return people;
}

}  // namespace palpate::trainer
