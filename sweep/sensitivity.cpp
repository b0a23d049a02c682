#include <sweep/sensitivity.h>

#include <base/folds.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace palpate::sweep {

namespace {

constexpr double rounding = 1e-12;  // of what does not vary: what a mean is off, as a fraction

// What does not vary depends on nothing. Its variance need not be 0, as its mean is rounded. Of the values that are finite.
bool varies(std::span<const double> values)
{
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const double v : values) {
        low = std::isfinite(v) ? std::min(low, v) : low;
        high = std::isfinite(v) ? std::max(high, v) : high;
    }
    return high - low > rounding * std::max(std::abs(low), std::abs(high));
}

bool isWhole(std::span<const double> sample)
{
    return std::ranges::all_of(sample, [](double v) { return std::isfinite(v); });
}

constexpr int resamples = 200;  // of the bootstrap
constexpr double z95 = 1.96;

double meanOf(std::span<const double> values)
{
    return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// One sample of a Saltelli design: outputs at a, b, and at a with each coordinate of b.
using Sample = std::span<const double>;

std::vector<SobolIndex> indicesOf(const std::vector<Sample>& samples, std::span<const std::size_t> chosen, std::size_t axes)
{
    const auto n = static_cast<double>(chosen.size());
    const double sum = base::sumOf(chosen, [&](std::size_t s) { return samples[s][0] + samples[s][1]; });
    const double mean = sum / (2 * n);
    double variance = 0;
    std::vector<SobolIndex> out(axes);
    for (const std::size_t s : chosen) {
        const double a = samples[s][0] - mean, b = samples[s][1] - mean;
        variance += (a * a + b * b) / (2 * n);
        for (std::size_t i = 0; i < axes; ++i) {
            const double mixed = samples[s][2 + i] - mean;
            out[i].first += b * (mixed - a) / n;
            out[i].total += (a - mixed) * (a - mixed) / (2 * n);
        }
    }
    for (SobolIndex& index : out) {
        index.first /= variance;
        index.total /= variance;
    }
    return variance > rounding * rounding * mean * mean ? out : std::vector<SobolIndex>();
}

}  // namespace

std::vector<SobolIndex> sobolIndices(std::span<const double> outputs, std::size_t axes)
{
    const std::size_t block = axes + 2;
    std::vector<Sample> samples;
    for (std::size_t at = 0; at + block <= outputs.size(); at += block) {
        const Sample sample = outputs.subspan(at, block);
        if (isWhole(sample)) {
            samples.push_back(sample);
        }
    }
    if (samples.size() < 2) {
        return {};
    }
    std::vector<std::size_t> chosen(samples.size());
    std::iota(chosen.begin(), chosen.end(), std::size_t{0});
    std::vector<SobolIndex> out = indicesOf(samples, chosen, axes);
    std::vector<SobolIndex> sum(axes), squares(axes);
    int counted = 0;
    for (int r = 0; r < resamples && !out.empty(); ++r) {
        for (std::size_t i = 0; i < chosen.size(); ++i) {
            chosen[i] = mixedSeed({static_cast<std::uint64_t>(r), i}) % samples.size();
        }
        const auto again = indicesOf(samples, chosen, axes);
        counted += again.empty() ? 0 : 1;
        for (std::size_t i = 0; i < again.size(); ++i) {
            sum[i].first += again[i].first;
            sum[i].total += again[i].total;
            squares[i].first += again[i].first * again[i].first;
            squares[i].total += again[i].total * again[i].total;
        }
    }
    const auto error = [&](double s, double s2) {
        return z95 * std::sqrt(std::max(0.0, s2 / counted - s * s / counted / counted));
    };
    for (std::size_t i = 0; i < out.size() && counted > 1; ++i) {
        out[i].firstError = error(sum[i].first, squares[i].first);
        out[i].totalError = error(sum[i].total, squares[i].total);
    }
    return out;
}

std::size_t wholeSamples(std::span<const double> outputs, std::size_t block)
{
    std::size_t count = 0;
    for (std::size_t at = 0; at + block <= outputs.size(); at += block) {
        count += isWhole(outputs.subspan(at, block)) ? 1 : 0;
    }
    return count;
}

std::vector<MorrisEffect> morrisEffects(const UnitPoints& points, std::span<const double> outputs)
{
    if (points.empty() || !varies(outputs)) {
        return {};
    }
    const std::size_t axes = points[0].size();
    std::vector<std::vector<double>> effects(axes);
    std::vector<bool> moves(axes, false);
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
        if ((i + 1) % (axes + 1) == 0) {
            continue;  // from one trajectory to the next
        }
        for (std::size_t a = 0; a < axes; ++a) {
            const double step = points[i + 1][a] - points[i][a];
            const double effect = (outputs[i + 1] - outputs[i]) / step;
            moves[a] = moves[a] || step != 0;
            if (step != 0 && std::isfinite(effect)) {
                effects[a].push_back(effect);
            }
        }
    }
    std::vector<MorrisEffect> out;
    for (std::size_t a = 0; a < axes; ++a) {
        const auto& e = effects[a];
        if (e.empty() && moves[a]) {
            return {};
        }
        MorrisEffect effect;
        effect.mean = e.empty() ? 0.0 : meanOf(e);
        for (const double v : e) {
            effect.absolute += std::abs(v) / static_cast<double>(e.size());
            effect.spread +=
                (v - effect.mean) * (v - effect.mean) / static_cast<double>(std::max<std::size_t>(e.size() - 1, 1));
        }
        effect.spread = std::sqrt(effect.spread);
        out.push_back(effect);
    }
    return out;
}

double mainEffect(std::span<const double> outputs, std::span<const std::size_t> level)
{
    const double mean = meanOf(outputs);
    std::vector<double> sum, count;
    double variance = 0;
    for (std::size_t i = 0; i < outputs.size(); ++i) {
        sum.resize(std::max(sum.size(), level[i] + 1));
        count.resize(sum.size());
        sum[level[i]] += outputs[i] - mean;
        count[level[i]] += 1;
        variance += (outputs[i] - mean) * (outputs[i] - mean);
    }
    double between = 0;
    for (std::size_t l = 0; l < sum.size(); ++l) {
        between += count[l] > 0 ? sum[l] * sum[l] / count[l] : 0.0;
    }
    return varies(outputs) ? between / variance : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace palpate::sweep
