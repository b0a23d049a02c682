#include <base/quantities.h>

#include <base/error.h>
#include <base/split.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <utility>

namespace palpate::base {

namespace {

// A number and what stands behind it, without the blanks between.
std::optional<std::pair<double, std::string_view>> split(std::string_view text)
{
    text = withoutPlus(text);
    double number = 0.0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc() || !std::isfinite(number)) {
        return std::nullopt;
    }
    std::string_view unit = text.substr(static_cast<std::size_t>(end - text.data()));
    unit.remove_prefix(std::min(unit.find_first_not_of(' '), unit.size()));
    return std::pair(number, unit);
}

std::optional<double> scaled(std::string_view text, std::initializer_list<std::pair<std::string_view, double>> units)
{
    const auto parts = split(text);
    for (const auto& [unit, scale] : units) {
        if (parts && parts->second == unit) {
            return scale * parts->first;
        }
    }
    return std::nullopt;
}

}  // namespace

std::optional<double> timeOf(std::string_view text)
{
    return scaled(text, {{"us", 1e-6}, {"ms", 1e-3}, {"s", 1.0}});
}

std::optional<double> lengthOf(std::string_view text)
{
    return scaled(text, {{"mm", 1e-3}, {"cm", 1e-2}, {"m", 1.0}});
}

std::optional<std::pair<int, int>> pixelsOf(std::string_view text)
{
    const std::size_t cross = std::min(text.find('x'), text.size());
    const auto width = numberIn<int>(text.substr(0, cross));
    const auto height = numberIn<int>(text.substr(std::min(cross + 1, text.size())));
    return width && height && *width > 0 && *height > 0 ? std::optional(std::pair(*width, *height)) : std::nullopt;
}

double parseShare(const std::string& option, const std::string& text)
{
    const auto parts = split(text);
    if (parts && (parts->second.empty() || parts->second == "%")) {
        const double fraction = parts->second.empty() ? parts->first : parts->first / 100.0;
        if (fraction > 0.0 && fraction < 1.0) {
            return fraction;
        }
    }
    throw base::error("{}: {}: must be over 0 % and under 100 %, as 3% or 0.03", option, text);
}

double parseTime(const std::string& option, const std::string& text)
{
    const auto seconds = timeOf(text);
    if (seconds && *seconds > 0.0 && *seconds <= 1.0) {
        return *seconds;
    }
    throw base::error("{}: {}: must be over 0 and up to 1 s, as 400us or 0.4ms", option, text);
}

double lengthFrom(const std::string& option, const std::string& text, double least, double most)
{
    const auto plain = lengthOf(text + "mm");
    return lengthWithin(option, text, plain ? plain : lengthOf(text), least, most);
}

double lengthWithin(const std::string& option, const std::string& text, std::optional<double> length, double least,
                    double most)
{
    base::failIf(!length || !(*length >= least && *length <= most), "{} {}: must be a length from {:g}mm to {:g}mm", option,
                 text, 1e3 * least, 1e3 * most);
    return *length;
}

}  // namespace palpate::base
