#include <render/result_file.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <fstream>

namespace palpate::render {

std::optional<ResultCard> readResult(const std::filesystem::path& file)
{
    std::ifstream in(file);
    const auto figures = nlohmann::json::parse(in, nullptr, false);
    if (!figures.is_object() || !figures.contains("score"))
        return std::nullopt;
    try {
        constexpr std::size_t most = 3;
        const auto& score = figures.at("score");
        ResultCard card;
        card.total = score.at("total").get<double>();
        for (const auto& [key, name, points] :
             {std::tuple{"core", "Core", 50}, {"vital", "Vital structures", 25}, {"technique", "Technique", 25}})
            card.parts.push_back(fmt::format("{} {:.0f} of {}", name, score.at("points").at(key).get<double>(), points));
        for (const auto& loss : score.value("losses", nlohmann::json::array()))
            if (card.losses.size() < most)
                card.losses.push_back(
                    fmt::format("-{:.0f}   {}", loss.at("points").get<double>(), loss.at("words").get<std::string>()));
        return card;
    } catch (const nlohmann::json::exception&) {
        return std::nullopt;
    }
}

}  // namespace palpate::render
