#include <base/told_losses.h>

#include <base/said.h>

namespace palpate::base {

namespace {

constexpr double shown = 0.05;  // by a decimal

}  // namespace

std::vector<std::size_t> toldLosses(std::span<const double> points)
{
    const double least = !points.empty() && points.front() > toldPoints ? toldPoints : shown;
    std::vector<std::size_t> told;
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (points[i] > least) {
            told.push_back(i);
        }
    }
    return told;
}

std::string lossInWords(double points)
{
    return points > toldPoints ? said("-{:.0f}", points) : said("-{:.1Lf}", points);
}

const char* headingOfLosses(double total, std::size_t told) noexcept
{
    return told == 0      ? tr("Nothing was lost")
           : total > 99.0 ? tr("Less than a point was lost")
                          : tr("Where the points went");
}

}  // namespace palpate::base
