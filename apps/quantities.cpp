#include <apps/quantities.h>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace palpate::apps {

namespace {

// A number and what stands behind it, without the blanks between.
std::optional<std::pair<double, std::string_view>> split(std::string_view text)
{
    double number = 0.0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc() || !std::isfinite(number)) {
        return std::nullopt;
    }
    std::string_view unit = text.substr(static_cast<std::size_t>(end - text.data()));
    unit.remove_prefix(std::min(unit.find_first_not_of(' '), unit.size()));
    return std::pair(number, unit);
}

}  // namespace

double parseShare(const std::string& option, const std::string& text)
{
    const auto parts = split(text);
    if (parts && (parts->second.empty() || parts->second == "%")) {
        const double share = parts->second.empty() ? parts->first : parts->first / 100.0;
        if (share > 0.0 && share < 1.0) {
            return share;
        }
    }
    throw std::runtime_error(fmt::format("{}: {}: must be over 0 % and under 100 %, as 3% or 0.03", option, text));
}

double parseTime(const std::string& option, const std::string& text)
{
    const auto parts = split(text);
    double seconds = 0.0;
    if (parts) {
        const double scale = parts->second == "us" ? 1e-6 : parts->second == "ms" ? 1e-3 : parts->second == "s" ? 1.0 : 0.0;
        seconds = scale * parts->first;
    }
    if (seconds > 0.0 && seconds <= 1.0) {
        return seconds;
    }
    throw std::runtime_error(fmt::format("{}: {}: must be over 0 and up to 1 s, as 400us or 0.4ms", option, text));
}

}  // namespace palpate::apps
