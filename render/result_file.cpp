#include <render/result_file.h>

#include <base/said.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <fstream>

namespace palpate::render {
namespace {

using base::marked;
using base::said;
using base::tr;

// The score of somebody who had something to find. Figures of older programs do not say it otherwise.
bool palpated(const nlohmann::json& score)
{
    const auto found = score.find("mark_error_mm");
    return found != score.end() && found->is_number();
}

}  // namespace

std::optional<ResultCard> readResult(const std::filesystem::path& file)
{
    std::ifstream in(file);
    const auto figures = nlohmann::json::parse(in, nullptr, false);
    if (!figures.is_object() || !figures.contains("score"))
        return std::nullopt;
    try {
        constexpr std::size_t most = 3;
        constexpr double least = 0.5;  // as haptics::toldPoints: less would contradict a total without decimals
        const auto& score = figures.at("score");
        const std::string judged = score.value("judged", palpated(score) ? "marks" : "core");
        ResultCard card;
        card.total = score.at("total").get<double>();
        for (const auto& [key, name, points] : {std::tuple{"core", base::nameOfCore(judged), 50},
                                                {"vital", marked("Vital structures"), 25},
                                                {"technique", marked("Technique"), 25}})
            card.parts.push_back(said(tr("{} {:.0f} of {}"), tr(name), score.at("points").at(key).get<double>(), points));
        if (figures.value("contacts", 1) == 0)
            card.losses.emplace_back(tr("The tool never touched the body: this session does not count."));
        for (const auto& loss : score.value("losses", nlohmann::json::array()))
            if (card.losses.size() < most && loss.at("points").get<double>() > least)
                card.losses.push_back(
                    fmt::format("-{:.0f}   {}", loss.at("points").get<double>(), loss.at("words").get<std::string>()));
        return card;
    } catch (const nlohmann::json::exception&) {
        return std::nullopt;
    }
}

}  // namespace palpate::render
