#include <render/result_file.h>

#include <base/said.h>
#include <base/told_losses.h>

#include <nlohmann/json.hpp>

#include <fstream>
#include <vector>

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
        const auto losses = score.value("losses", nlohmann::json::array());
        std::vector<double> points;
        for (const auto& loss : losses)
            points.push_back(loss.at("points").get<double>());
        for (const std::size_t i : base::toldLosses(points))
            if (card.losses.size() < most)
                card.losses.push_back(base::lossInWords(points[i]) + "   " + losses[i].at("words").get<std::string>());
        return card;
    } catch (const nlohmann::json::exception&) {
        return std::nullopt;
    }
}

}  // namespace palpate::render
