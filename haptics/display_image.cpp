#include <haptics/display_image.h>

#include <haptics/scenery.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <utility>

namespace palpate::haptics {

namespace {

using channel::GreyWindow;

constexpr double around = 30e-3;  // of the aim [m]

// What radiologists look at CT through: OHIF's presets, width and level 400 40, 1500 -600, 2500 480
// (defaultWindowLevelPresets.ts of OHIF/Viewers).
std::vector<GreyWindow> windowsOfCt()
{
    return {{nameOf("soft tissue"), -160, 240}, {nameOf("lung"), -1350, 150}, {nameOf("bone"), -770, 1730}};
}

// The values within `around` of the aim; none without a planned line.
std::vector<float> valuesAround(const volume::NodeGrid& grid, const std::vector<float>& values,
                                const channel::Scenery& scenery)
{
    std::vector<float> near;
    if (scenery.entry == scenery.aim) {
        return near;
    }
    const Vec3 aim(scenery.aim[0], scenery.aim[1], scenery.aim[2]);
    for (std::size_t i = 0; i < values.size(); ++i) {
        if (std::isfinite(values[i]) && glm::distance(grid.position(grid.node(i)), aim) <= around) {
            near.push_back(values[i]);
        }
    }
    return near;
}

// Nearest rank; takes the values to pieces.
GreyWindow percentiles(const std::string& name, std::vector<float> values)
{
    const auto at = [&](double fraction) {
        const auto rank = static_cast<std::ptrdiff_t>(std::llround(fraction * static_cast<double>(values.size() - 1)));
        std::nth_element(values.begin(), values.begin() + rank, values.end());
        return static_cast<double>(values[static_cast<std::size_t>(rank)]);
    };
    const double low = at(0.01), high = at(0.99);
    // What is the same everywhere is in the middle.
    return high > low ? GreyWindow{nameOf(name), low, high} : GreyWindow{nameOf(name), low - 1, low + 1};
}

std::vector<GreyWindow> windowsOf(std::vector<float> body, std::vector<float> near, const std::string& unit)
{
    if (unit != "HU") {
        std::vector<GreyWindow> windows{percentiles("body", std::move(body))};
        if (!near.empty()) {
            windows.push_back(percentiles("around the target", std::move(near)));
        }
        return windows;
    }
    const std::vector<float>& judged = near.empty() ? body : near;
    auto windows = windowsOfCt();
    const auto shows = [&](const GreyWindow& w) {
        const auto shown = std::count_if(judged.begin(), judged.end(), [&](float v) { return v >= w.low && v <= w.high; });
        return 2 * static_cast<std::size_t>(shown) >= judged.size();
    };
    const auto best = std::find_if(windows.begin(), windows.end(), shows);
    if (best != windows.end()) {
        std::rotate(windows.begin(), best, best + 1);
    }
    return windows;
}

// Gives nodes without a value that touch nodes with one their mean.
std::vector<float> grown(const volume::NodeGrid& grid, const std::vector<float>& values)
{
    const auto meanAround = [&](Index3 n) {
        float sum = 0;
        float count = 0;
        volume::forEachIndex(glm::max(n - 1, 0), glm::min(n + 1, grid.size - 1), [&](Index3 at) {
            const float value = values[grid.offset(at)];
            sum += std::isfinite(value) ? value : 0.0F;
            count += std::isfinite(value) ? 1.0F : 0.0F;
        });
        return sum / count;
    };
    std::vector<float> out = values;
    for (std::size_t i = 0; i < out.size(); ++i) {
        if (!std::isfinite(values[i])) {
            out[i] = meanAround(grid.node(i));
        }
    }
    return out;
}

}  // namespace

std::vector<std::uint16_t> displayImage(const volume::NodeGrid& grid, const std::vector<float>& values,
                                        const std::string& unit, channel::Scenery& scenery,
                                        const std::vector<float>& beyond)
{
    std::vector<float> body;
    std::copy_if(values.begin(), values.end(), std::back_inserter(body), [](float v) { return std::isfinite(v); });
    scenery.windows = 0;
    if (body.empty()) {
        return {};
    }
    const auto [first, last] = std::minmax_element(body.begin(), body.end());
    float least = *first, most = *last;
    for (const float v : beyond) {
        least = std::isfinite(v) ? std::min(least, v) : least;
        most = std::isfinite(v) ? std::max(most, v) : most;
    }
    constexpr double codes = 65535;
    const double low = static_cast<double>(least), step = (static_cast<double>(most) - low) / codes;
    scenery.imageLow = low;
    scenery.imageStep = step;
    scenery.imageUnit = nameOf(unit);
    const auto windows = windowsOf(std::move(body), valuesAround(grid, values, scenery), unit);
    scenery.windows = static_cast<std::uint32_t>(windows.size());
    std::copy(windows.begin(), windows.end(), scenery.window.begin());

    std::vector<std::uint16_t> image(values.size(), 0);
    std::vector<float> wide = grown(grid, values);
    for (std::size_t i = 0; i < beyond.size(); ++i) {
        wide[i] = std::isfinite(wide[i]) ? wide[i] : beyond[i];
    }
    for (std::size_t i = 0; i < image.size(); ++i) {
        if (std::isfinite(wide[i]) && step > 0) {
            image[i] = static_cast<std::uint16_t>(std::llround((static_cast<double>(wide[i]) - low) / step));
        }
    }
    return image;
}

}  // namespace palpate::haptics
