#include <report/chart/labels.h>

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

namespace palpate::report {

namespace {

struct Rectangle {
    glm::dvec2 low{0.0}, high{0.0};
};

double common(const Rectangle& a, const Rectangle& b)
{
    const double wide = std::min(a.high.x, b.high.x) - std::max(a.low.x, b.low.x);
    const double tall = std::min(a.high.y, b.high.y) - std::max(a.low.y, b.low.y);
    return std::max(wide, 0.0) * std::max(tall, 0.0);
}

// Around a point, the best first: right above, right below, left above, left below, then further up and down.
std::array<glm::dvec2, 6> sides(glm::dvec2 size)
{
    constexpr double beside = 11;
    const double up = 0.75 * size.y;
    const double left = -beside - size.x;
    return {glm::dvec2(beside, up), {beside, -up}, {left, up}, {left, -up}, {beside, 2.5 * up}, {beside, -2.5 * up}};
}

}  // namespace

std::vector<glm::dvec2> placedLabels(std::span<const PointLabel> labels, std::span<const glm::dvec2> markers)
{
    constexpr glm::dvec2 markerReach(7.0);
    constexpr double textCounts = 4;  // letters over letters cannot be read, a marker behind them can
    std::vector<Rectangle> texts;
    std::vector<glm::dvec2> out;
    for (const PointLabel& label : labels) {
        double least = std::numeric_limits<double>::infinity();
        std::pair<glm::dvec2, Rectangle> best;
        for (const glm::dvec2 side : sides(label.size)) {
            const glm::dvec2 low = label.point + side - glm::dvec2(0, 0.5 * label.size.y);
            const Rectangle text{low, low + label.size};
            double covered = 0;
            for (const Rectangle& other : texts) {
                covered += textCounts * common(text, other);
            }
            for (const glm::dvec2 marker : markers) {
                covered += common(text, {marker - markerReach, marker + markerReach});
            }
            if (covered < least) {
                least = covered;
                best = {side, text};
            }
        }
        out.push_back(best.first);
        texts.push_back(best.second);
    }
    return out;
}

}  // namespace palpate::report
