#include <sweep/design.h>

#include <base/error.h>
#include <boost/random/sobol.hpp>

#include <algorithm>
#include <utility>

namespace palpate::sweep {

namespace {

constexpr double unit = 0x1p-53;

std::uint64_t split(std::uint64_t& state) noexcept
{
    std::uint64_t z = (state += 0x9E3779B97F4A7C15U);
    z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27U)) * 0x94D049BB133111EBU;
    return z ^ (z >> 31U);
}

double uniform(std::uint64_t& state) noexcept
{
    return static_cast<double>(split(state) >> 11U) * unit;
}

std::size_t below(std::uint64_t& state, std::size_t count) noexcept
{
    return static_cast<std::size_t>(uniform(state) * static_cast<double>(count));
}

std::vector<std::size_t> shuffled(std::size_t count, std::uint64_t& state)
{
    std::vector<std::size_t> out(count);
    for (std::size_t i = 0; i < count; ++i) {
        out[i] = i;
        std::swap(out[i], out[below(state, i + 1)]);
    }
    return out;
}

}  // namespace

std::uint64_t mixedSeed(std::initializer_list<std::uint64_t> parts) noexcept
{
    std::uint64_t state = 0;
    for (const std::uint64_t part : parts) {
        state = split(state) ^ part;
    }
    return split(state);
}

UnitPoints latinHypercube(std::size_t samples, std::size_t axes, std::uint64_t seed)
{
    UnitPoints points(samples, std::vector<double>(axes));
    std::uint64_t state = seed;
    for (std::size_t a = 0; a < axes; ++a) {
        const auto stratum = shuffled(samples, state);
        for (std::size_t i = 0; i < samples; ++i) {
            const double in = static_cast<double>(stratum[i]) + uniform(state);
            points[i][a] = std::min(in / static_cast<double>(samples), 1.0 - unit);
        }
    }
    return points;
}

UnitPoints sobolPoints(std::size_t samples, std::size_t axes, std::uint64_t seed)
{
    static_assert(maxSobolAxes == boost::random::default_sobol_table::max_dimension);
    base::failIf(axes < 1 || axes > maxSobolAxes, "Sobol's points have 1 to {} axes, not {}", maxSobolAxes, axes);
    boost::random::sobol engine(axes);
    std::uint64_t state = seed;
    std::vector<std::uint64_t> shift(axes);
    std::generate(shift.begin(), shift.end(), [&] { return split(state); });
    UnitPoints points(samples, std::vector<double>(axes));
    for (std::size_t i = 0; i < samples; ++i) {
        for (std::size_t a = 0; a < axes; ++a) {
            // Boost leaves out the sequence's first point, the origin.
            const std::uint64_t bits = i == 0 ? 0 : engine();
            points[i][a] = static_cast<double>((bits ^ shift[a]) >> 11U) * unit;
        }
    }
    return points;
}

UnitPoints saltelliPoints(std::size_t samples, std::size_t axes, std::uint64_t seed)
{
    UnitPoints points;
    for (const auto& both : sobolPoints(samples, 2 * axes, seed)) {
        const auto half = both.begin() + static_cast<std::ptrdiff_t>(axes);
        const std::vector<double> a(both.begin(), half), b(half, both.end());
        points.push_back(a);
        points.push_back(b);
        for (std::size_t i = 0; i < axes; ++i) {
            points.push_back(a);
            points.back()[i] = b[i];
        }
    }
    return points;
}

UnitPoints morrisPoints(std::size_t samples, std::size_t axes, std::uint64_t seed)
{
    UnitPoints points;
    std::uint64_t state = seed;
    for (std::size_t t = 0; t < samples; ++t) {
        std::vector<double> at(axes);
        for (double& x : at) {
            x = static_cast<double>(below(state, morrisLevels)) / (morrisLevels - 1);
        }
        const auto inside = [](double x) { return std::min(x, 1.0 - unit); };
        const auto add = [&] {
            points.push_back(at);
            std::transform(at.begin(), at.end(), points.back().begin(), inside);
        };
        add();
        for (const std::size_t a : shuffled(axes, state)) {
            at[a] += at[a] < 0.5 ? morrisStep : -morrisStep;
            add();
        }
    }
    return points;
}

}  // namespace palpate::sweep
