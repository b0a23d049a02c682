#include <studies/thesis/tasks_fit.h>

#include <base/error.h>

#include <boost/math/distributions/students_t.hpp>

#include <cassert>
#include <cmath>
#include <numeric>

namespace palpate::studies {

bool LineFit::flat() const noexcept
{
    return std::abs(slope) <= studentQuantile(points - 2) * slopeError;
}

LineFit fitLine(std::span<const double> x, std::span<const double> y)
{
    assert(x.size() == y.size());
    base::failIf(x.size() < 3, "a line with errors needs three points or more");
    const auto n = static_cast<double>(x.size());
    const double meanX = std::accumulate(x.begin(), x.end(), 0.0) / n;
    const double meanY = std::accumulate(y.begin(), y.end(), 0.0) / n;
    double xx = 0.0, xy = 0.0, yy = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) {
        xx += (x[i] - meanX) * (x[i] - meanX);
        xy += (x[i] - meanX) * (y[i] - meanY);
        yy += (y[i] - meanY) * (y[i] - meanY);
    }
    base::failIf(!(xx > 0.0), "a line needs points at different places");
    LineFit fit;
    fit.points = x.size();
    fit.slope = xy / xx;
    fit.intercept = meanY - fit.slope * meanX;
    double squares = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) {
        const double off = y[i] - fit.at(x[i]);
        squares += off * off;
    }
    fit.residual = std::sqrt(squares / (n - 2.0));
    fit.slopeError = fit.residual / std::sqrt(xx);
    fit.interceptError = fit.residual * std::sqrt(1.0 / n + meanX * meanX / xx);
    fit.rSquared = yy > 0.0 ? 1.0 - squares / yy : 1.0;
    return fit;
}

double studentQuantile(std::size_t freedom) noexcept
{
    assert(freedom > 0);
    return boost::math::quantile(boost::math::students_t(static_cast<double>(freedom)), 0.975);
}

}  // namespace palpate::studies
