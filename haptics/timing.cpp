#include <haptics/timing.h>

#include <boost/histogram.hpp>

#include <algorithm>
#include <vector>

namespace palpate::haptics {

namespace bh = boost::histogram;
using Axis = bh::axis::regular<double, bh::axis::transform::log>;
constexpr unsigned bins = 2083;  // 1 % apart over nine decades

struct Histogram::Impl {
    bh::histogram<std::tuple<Axis>, bh::storage_adaptor<std::vector<std::uint64_t>>> bins_{Axis(bins, 1e-8, 10.0)};
    std::uint64_t count = 0;
    double max = 0;
};

Histogram::Histogram() : impl_(std::make_unique<Impl>()) {}
Histogram::Histogram(Histogram&&) noexcept = default;
Histogram& Histogram::operator=(Histogram&&) noexcept = default;
Histogram::~Histogram() = default;

void Histogram::add(double seconds) noexcept
{
    impl_->bins_(seconds);
    impl_->max = std::max(impl_->max, seconds);
    ++impl_->count;
}

double Histogram::quantile(double fraction) const noexcept
{
    const auto& axis = impl_->bins_.axis();
    const double wanted = fraction * static_cast<double>(impl_->count);
    double seen = 0.0;
    for (int i = -1; i <= axis.size(); ++i) {
        seen += static_cast<double>(impl_->bins_.at(i));
        if (seen >= wanted && seen > 0.0) {
            return i < 0 ? axis.value(0) : std::min(axis.value(i + 1), impl_->max);
        }
    }
    return impl_->max;
}

Percentiles Histogram::percentiles() const
{
    return {quantile(0.5), quantile(0.99), quantile(0.999), impl_->max};
}

std::uint64_t Histogram::count() const noexcept
{
    return impl_->count;
}

}  // namespace palpate::haptics
