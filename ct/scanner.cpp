#include <ct/scanner.h>

#include <base/cells.h>
#include <base/ct_number.h>
#include <base/png.h>
#include <channel/needle_shape.h>

#include <nlohmann/json.hpp>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

namespace palpate::ct {

namespace {

using channel::vec;

constexpr auto air = static_cast<float>(base::ctNumberOfAir), steel = static_cast<float>(base::ctNumberOfSteel);  // [HU]
// What a core leaves: half blood, half air, assumed.
constexpr float inHole = 0.5F * (55 + air);    // [HU]
constexpr int lowest = -1024, highest = 3071;  // of 12 bits
constexpr double sharpness = 1.0e-3;           // full width at half maximum of a point in the slice [m], assumed
constexpr double widest = 0.256;               // of the picture [m]
constexpr double usualNoise = 12, usualDose = 10, usualWidth = 5e-3;  // [HU], [mGy], [m]
constexpr int pixels = 320, planesOfSlice = 3;

// Weights of a point's spread, from its middle on.
std::vector<float> spread(double pixel)
{
    const double deviation = sharpness / 2.3548 / pixel;
    std::vector<float> weights(1 + static_cast<std::size_t>(std::ceil(3 * deviation)));
    double sum = 0;
    for (std::size_t i = 0; i < weights.size(); ++i) {
        const double x = static_cast<double>(i) / deviation;
        weights[i] = static_cast<float>(std::exp(-0.5 * x * x));
        sum += static_cast<double>(weights[i]) * (i == 0 ? 1 : 2);
    }
    for (float& w : weights)
        w /= static_cast<float>(sum);
    return weights;
}

// Along x, and the picture turned over its diagonal: twice is a blur along both and the picture as it was.
std::vector<float> blurredAndTurned(const std::vector<float>& in, int side, const std::vector<float>& weights)
{
    std::vector<float> out(in.size());
    const auto n = static_cast<int>(weights.size());
    for (int y = 0; y < side; ++y) {
        const float* row = &in[static_cast<std::size_t>(y) * static_cast<std::size_t>(side)];
        for (int x = 0; x < side; ++x) {
            float sum = weights[0] * row[x];
            for (int i = 1; i < n; ++i)
                sum += weights[static_cast<std::size_t>(i)] * (row[std::max(x - i, 0)] + row[std::min(x + i, side - 1)]);
            out[static_cast<std::size_t>(x) * static_cast<std::size_t>(side) + static_cast<std::size_t>(y)] = sum;
        }
    }
    return out;
}

// What is left of white noise's deviation behind the spread.
double kept(const std::vector<float>& weights)
{
    double squares = 0;
    for (std::size_t i = 0; i < weights.size(); ++i)
        squares += static_cast<double>(weights[i]) * static_cast<double>(weights[i]) * (i == 0 ? 1 : 2);
    return squares;
}

double distanceToNeedle(const channel::NeedleShape& needle, glm::dvec3 p)
{
    double least = 1e9;
    for (std::size_t i = 0; i + 1 < needle.size(); ++i) {
        const glm::dvec3 along = needle[i + 1] - needle[i];
        const double length = glm::dot(along, along);
        const double t = length > 0 ? std::clamp(glm::dot(p - needle[i], along) / length, 0.0, 1.0) : 0.0;
        least = std::min(least, glm::distance(p, needle[i] + t * along));
    }
    return least;
}

}  // namespace

double noiseOf(double width, double doseIndex) noexcept
{
    return usualNoise * std::sqrt(usualDose * usualWidth / (doseIndex * width));
}

std::uint8_t Window::grey(double hu) const noexcept
{
    return static_cast<std::uint8_t>(std::lround(255 * std::clamp((hu - low) / (high - low), 0.0, 1.0)));
}

// A plane of sums over the planes of a slice.
struct Scanner::Plane {
    const Scan& frame;
    double z;
    std::vector<float>& sum;
};

Scanner::Scanner(const channel::Scenery& scenery, std::span<const std::uint16_t> image) : scenery_(scenery)
{
    for (std::size_t t = 1; t < number_.size(); ++t)
        number_[t] = base::ctNumberOf(static_cast<double>(scenery.sound[t].density));
    number_[0] = air;
    const std::string_view unit(scenery.imageUnit.data());
    if (unit == "HU")
        image_.assign(image.begin(), image.end());
}

// Of the image where it is CT and has the place, else of the tissue.
float Scanner::numberAt(const channel::Deformation& body, glm::dvec3 rest) const noexcept
{
    const channel::Grid& grid = scenery_.labels;
    const std::uint8_t row = body.restLabel(rest) & channel::rowBits;
    if (!image_.empty()) {
        const glm::dvec3 g = glm::round((rest - vec(grid.origin)) / grid.spacing);
        if (g.x >= 0 && g.y >= 0 && g.z >= 0 && g.x < grid.size[0] && g.y < grid.size[1] && g.z < grid.size[2])
            return row != 0 ? codeAt(glm::ivec3(g)) : numberBeside(body, glm::ivec3(g));
    }
    return number_[row];
}

float Scanner::codeAt(glm::ivec3 node) const noexcept
{
    const std::size_t at = base::offsetOf(channel::sizeOf(scenery_.labels), node);
    return static_cast<float>(scenery_.imageLow + scenery_.imageStep * image_[at]);
}

// Outside the body, where the image goes on (a table, tissue without a label). The nodes next to the body have numbers of
// tissue instead, so that viewers may interpolate: what is there is taken from behind them.
float Scanner::numberBeside(const channel::Deformation& body, glm::ivec3 node) const noexcept
{
    const glm::ivec3 size = channel::sizeOf(scenery_.labels);
    const auto isBody = [&](glm::ivec3 n) {
        return base::holds(size, n) && (body.labels()[base::offsetOf(size, n)] & channel::rowBits) != 0;
    };
    glm::vec3 away(0);  // from the tissue around
    bool beside = false;
    for (int z = -1; z <= 1; ++z)
        for (int y = -1; y <= 1; ++y)
            for (int x = -1; x <= 1; ++x)
                if (isBody(node + glm::ivec3(x, y, z))) {
                    beside = true;
                    away -= glm::vec3(x, y, z);
                }
    const auto outside = [&](glm::ivec3 n) {
        const float number = codeAt(n);
        return number > static_cast<float>(scenery_.imageLow) ? number : air;  // code 0: the image ends before
    };
    if (!beside)
        return outside(node);
    const float length = glm::length(away);
    if (!(length > 0))
        return air;
    constexpr float behind = 3;  // from a node of the body past the next but one
    const glm::ivec3 there = node + glm::ivec3(glm::round(behind / length * away));
    return base::holds(size, there) && !isBody(there) ? outside(there) : air;
}

// How much of a pixel around a place at rest cores have left empty.
float Scanner::shareOfHoles(const channel::State& state, const channel::Deformation& body, glm::dvec3 rest,
                            double pixel) const noexcept
{
    double share = 0;
    for (std::size_t i = 0; i < std::min<std::size_t>(state.holes, state.hole.size()); ++i) {
        const auto& [begin, end] = state.hole[i];
        const glm::dvec3 from(begin[0], begin[1], begin[2]), way = glm::dvec3(end[0], end[1], end[2]) - from;
        const double square = glm::dot(way, way), along = glm::dot(rest - from, way);
        if (!(square > 0) || along < 0 || along > square)
            continue;
        const double beside = glm::distance(rest, from + along / square * way);
        share = std::max(share, std::clamp((scenery_.holeRadius - beside) / pixel + 0.5, 0.0, 1.0));
    }
    return share > 0 && (body.restLabel(rest) & channel::rowBits) != 0 ? static_cast<float>(share) : 0.0F;
}

void Scanner::addPlane(const channel::State& state, const channel::Deformation& body, Plane& plane) const
{
    const Scan& f = plane.frame;
    const bool metal = scenery_.tool == channel::ToolKind::needle;
    const channel::NeedleShape needle = metal ? channel::needleShape(scenery_, state) : channel::NeedleShape{};
    const double radius = scenery_.toolRadius;
    glm::dvec2 low(1e9), high(-1e9);  // around the needle
    for (const glm::dvec3& p : needle) {
        low = glm::min(low, glm::dvec2(p) - radius - f.pixel);
        high = glm::max(high, glm::dvec2(p) + radius + f.pixel);
    }
    for (int y = 0; y < f.side; ++y) {
        glm::vec3 shift(0);
        for (int x = 0; x < f.side; ++x) {
            const glm::dvec3 p(f.corner.x + x * f.pixel, f.corner.y + y * f.pixel, plane.z);
            const glm::dvec3 rest = body.rest(p, shift);
            float hu = numberAt(body, rest);
            hu += shareOfHoles(state, body, rest, f.pixel) * (inHole - hu);
            if (metal && p.x > low.x && p.y > low.y && p.x < high.x && p.y < high.y) {
                const double fraction = std::clamp((radius - distanceToNeedle(needle, p)) / f.pixel + 0.5, 0.0, 1.0);
                hu += static_cast<float>(fraction) * (steel - hu);
            }
            plane.sum[static_cast<std::size_t>(y * f.side + x)] += hu / planesOfSlice;
        }
    }
}

std::vector<float> Scanner::slice(const channel::State& state, const channel::Deformation& body, const Scan& frame,
                                  double height) const
{
    std::vector<float> hu(static_cast<std::size_t>(frame.side) * static_cast<std::size_t>(frame.side));
    for (int i = 0; i < planesOfSlice; ++i) {
        Plane plane{frame, height + ((i + 0.5) / planesOfSlice - 0.5) * scenery_.ctWidth, hu};
        addPlane(state, body, plane);
    }
    return hu;
}

Scan Scanner::scan(const channel::State& state, const channel::Deformation& body) const
{
    const channel::Grid& grid = scenery_.labels;
    const glm::dvec3 size = grid.spacing * glm::dvec3(channel::sizeOf(grid));
    const glm::dvec3 tip = vec(state.tip), middle = vec(grid.origin) + 0.5 * (size - grid.spacing);
    Scan scan;
    scan.side = pixels;
    const double wide = std::min(widest, std::max(size.x, size.y));
    scan.pixel = wide / pixels;
    const auto centred = [&](double around, double extent, double at) {
        return extent <= wide ? at : std::clamp(around, at - 0.5 * (extent - wide), at + 0.5 * (extent - wide));
    };
    scan.corner =
        glm::dvec2(centred(tip.x, size.x, middle.x), centred(tip.y, size.y, middle.y)) - 0.5 * (wide - scan.pixel);
    const std::vector<float> weights = spread(scan.pixel);
    std::mt19937_64 random(state.tick ^ 0x63745f6e6f697365U);
    std::normal_distribution<float> noise(
        0, static_cast<float>(noiseOf(scenery_.ctWidth, scenery_.ctDoseIndex) / kept(weights)));
    const auto count = static_cast<int>(scenery_.ctSlices);
    for (int k = 0; k < count; ++k) {
        scan.height.push_back(tip.z + (k - count / 2) * scenery_.ctWidth);
        std::vector<float> hu = slice(state, body, scan, scan.height.back());
        for (float& value : hu)
            value += noise(random);
        hu = blurredAndTurned(blurredAndTurned(hu, scan.side, weights), scan.side, weights);
        std::vector<std::int16_t> whole(hu.size());
        std::transform(hu.begin(), hu.end(), whole.begin(), [](float v) {
            return static_cast<std::int16_t>(std::clamp(static_cast<int>(std::lround(v)), lowest, highest));
        });
        scan.hu.push_back(std::move(whole));
    }
    return scan;
}

std::vector<std::uint8_t> shown(const Scan& scan, std::size_t slice, const Window& window, int side)
{
    std::vector<std::uint8_t> grey;
    grey.reserve(static_cast<std::size_t>(side) * static_cast<std::size_t>(side));
    const double step = static_cast<double>(scan.side) / side, last = scan.side - 1.001;
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x) {
            // Linear between pixels.
            const double u = std::clamp((x + 0.5) * step - 0.5, 0.0, last),
                         v = std::clamp((y + 0.5) * step - 0.5, 0.0, last);
            const int i = static_cast<int>(u), j = static_cast<int>(v);
            const double above = glm::mix<double, double>(scan.at(slice, i, j), scan.at(slice, i + 1, j), u - i);
            const double below = glm::mix<double, double>(scan.at(slice, i, j + 1), scan.at(slice, i + 1, j + 1), u - i);
            grey.push_back(window.grey(glm::mix(above, below, v - j)));
        }
    return grey;
}

std::string scanPng(const Scan& scan, std::uint64_t tick, double doseLength, const Window& window, int side)
{
    const std::size_t count = scan.hu.size(), tall = static_cast<std::size_t>(side), wide = count * tall;
    std::vector<std::uint8_t> grey(wide * tall);
    for (std::size_t k = 0; k < count; ++k) {
        const std::vector<std::uint8_t> one = shown(scan, k, window, side);
        for (std::size_t y = 0; y < tall; ++y)
            std::copy_n(&one[y * tall], tall, &grey[y * wide + k * tall]);
    }
    // Of the middle of this picture's first pixel; the corners of both pictures are the same.
    const double pixel = scan.pixel * scan.side / side;
    const glm::dvec2 corner = scan.corner + 0.5 * (pixel - scan.pixel);
    const nlohmann::json text{{"tick", tick},
                              {"slice_z_m", scan.height},
                              {"corner_m", {corner.x, corner.y}},
                              {"pixel_m", pixel},
                              {"window_hu", {window.low, window.high}},
                              {"dose_mgy_cm", doseLength}};
    return base::greyPng(static_cast<int>(wide), side, grey, "palpate-ct", text.dump());
}

}  // namespace palpate::ct
