#pragma once

#include <base/error.h>
#include <datasets/toml_section.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <variant>

namespace palpate::datasets {

/// One key of a table and the member of T that it sets.
template <class T>
struct Field {
    std::string_view key;
    std::string_view unit;
    double low = 0, high = 0;  // in `unit`; of numbers
    double si = 1;             // SI units in one `unit`
    std::variant<double T::*, float T::*, std::uint32_t T::*, int T::*, bool T::*, std::string T::*> member;
};

enum class Need : std::uint8_t { all, some };

/// Sets the members of `target` whose keys are there; with Need::all a key that is not there is an error.
template <class T>
void readFields(Section& section, std::span<const Field<T>> fields, T& target, Need need)
{
    for (const Field<T>& f : fields) {
        std::visit(
            [&](auto member) {
                using Value = std::remove_reference_t<decltype(target.*member)>;
                if constexpr (std::is_same_v<Value, bool>) {
                    target.*member = section.flag(f.key).value_or(target.*member);
                } else if constexpr (std::is_same_v<Value, std::string>) {
                    target.*member = section.word(f.key).value_or(target.*member);
                } else if constexpr (std::is_same_v<Value, std::uint32_t> || std::is_same_v<Value, int>) {
                    const auto low = static_cast<std::int64_t>(f.low), high = static_cast<std::int64_t>(f.high);
                    target.*member = static_cast<Value>(section.integer(f.key, f.unit, low, high).value_or(target.*member));
                } else if (const auto v = section.number(f.key, f.unit, f.low, f.high)) {
                    target.*member = static_cast<Value>(*v * f.si);
                }
            },
            f.member);
        section.missingIf(need == Need::all && !section.has(f.key), f.key, f.unit);
    }
}

/// Refuses a number of `source` outside of the limits of its field: "PLACE window = 0: must be 9 to 41". Throws
/// std::runtime_error.
template <class T>
void checkFields(std::string_view place, std::span<const Field<T>> fields, const T& source)
{
    constexpr double rounding = 1e-9;  // of units, relative
    for (const Field<T>& f : fields) {
        std::visit(
            [&](auto member) {
                using Value = std::remove_cvref_t<decltype(source.*member)>;
                if constexpr (std::is_arithmetic_v<Value> && !std::is_same_v<Value, bool>) {
                    const double value = static_cast<double>(source.*member) / f.si;
                    const double slack = rounding * std::max(std::abs(f.low), std::abs(f.high));
                    const std::string_view gap = f.unit.empty() ? "" : " ";
                    base::failIf(!(value >= f.low - slack && value <= f.high + slack),
                                 "{} {} = {:g}{}{}: must be {:g} to {:g}{}{}", place, f.key, value, gap, f.unit, f.low,
                                 f.high, gap, f.unit);
                }
            },
            f.member);
    }
}

/// The fields of `source` as TOML lines, so that readFields() gives them back.
template <class T>
std::string writeFields(std::span<const Field<T>> fields, const T& source)
{
    std::string out;
    for (const Field<T>& f : fields) {
        out += std::visit(
            [&](auto member) {
                using Value = std::remove_cvref_t<decltype(source.*member)>;
                if constexpr (std::is_same_v<Value, std::string>) {
                    return fmt::format("{} = {}\n", f.key, tomlString(source.*member));
                } else if constexpr (std::is_floating_point_v<Value>) {
                    return fmt::format("{} = {:.12g}\n", f.key, static_cast<double>(source.*member) / f.si);
                } else {
                    return fmt::format("{} = {}\n", f.key, source.*member);
                }
            },
            f.member);
    }
    return out;
}

}  // namespace palpate::datasets
