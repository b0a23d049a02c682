#include <studies/kernel/machine_rates.h>

#include <base/error.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <string_view>
#include <vector>

namespace palpate::studies {

namespace {

constexpr int tries = 15;
constexpr int rounds = 20000;
constexpr std::size_t copied = 64U << 10;  // floats: 256 KB each way, beyond any first-level cache and within the second

// The best of a few tries, per second: what else runs on the machine only takes away from it.
template <typename Loop>
double best(Loop&& loop)
{
    using Clock = std::chrono::steady_clock;
    double most = 0.0;
    for (int i = 0; i < tries; ++i) {
        const auto start = Clock::now();
        const double amount = loop();
        most = std::max(most, amount / std::chrono::duration<double>(Clock::now() - start).count());
    }
    return most;
}

}  // namespace

MachineRates machineRates(const char* name)
{
    constexpr int passes = 20;
    static constexpr std::array<const RateLoops*, 3> sets{&ratesV2, &ratesAvx2, &ratesAvx512};
    const auto* const found =
        std::ranges::find_if(sets, [&](const RateLoops* s) { return std::string_view(s->name) == name; });
    base::failIf(found == sets.end(), "instruction set '{}': its rates cannot be measured", name);
    const RateLoops& loops = **found;
    const std::vector<float> from(copied, 1.0F);
    std::vector<float> to(copied, 0.0F);
    MachineRates rates;
    rates.additions = best([&] { return loops.add(rounds); });
    rates.multiplications = best([&] { return loops.multiply(rounds); });
    rates.both = best([&] { return loops.both(rounds); });
    rates.bytes = best([&] {
        double sum = 0.0;
        for (int i = 0; i < passes; ++i) {
            sum += loops.copy(from.data(), to.data(), copied);
        }
        return sum;
    });
    return rates;
}

}  // namespace palpate::studies
