#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>

namespace palpate::volume {

/// What tissue's energy has beyond mu/2 I at an invariant I >= 0, as its law says: W = mu/2 I + energy, and what keeps the
/// volume. Where no volume changes, I = I_C - 3. `Number` is float, double or a vector of floats: kernel, reference and
/// studies call the same formulas.
template <typename Number>
struct Stiffening {
    Number energy{};     // [as mu]
    Number slope{};      // 2 d(energy)/dI: what is added to mu in the stress [as mu]
    Number curvature{};  // d(slope)/dI [as mu]
};

/// The invariant I of a stretch, and its derivatives.
template <typename Number>
struct Invariant {
    Number i{};         // not under 0; there no law has a slope [-]
    Number byShape{};   // dI / d(shape)
    Number byVolume{};  // dI / d(change)
};

/// I = J^(-2/3) I_C - 3, which pressure alone does not change: J^(-2/3) times (shape + w), w being what `shape` lacks where
/// only the volume changes, 3 + 2 (J - 1) - 3 J^(2/3). Both are their series about J = 1, with one term more for J < 1, and
/// constant beyond J = 0 and 1.6: so nothing ends where a cell is inverted. I is right within 2 % from J = 0.65 to 1.3.
/// @param shape   I_C - 3 - 2 (J - 1): both arguments without small differences of large numbers
/// @param change  J - 1
template <typename Number>
[[gnu::always_inline]] inline Invariant<Number> isochoric(Number shape, Number change) noexcept
{
    constexpr float most = 0.6F;  // where the quadratic of J^(-2/3) is lowest
    const Number above = change > most ? Number{} + most : change;
    const Number v = above < -1.0F ? Number{} - 1.0F : above;
    const Number pressed = v < 0.0F ? v : Number{};
    const Number square = v * v, cube = pressed * square;
    const Number share = 1.0F + v * (v * (5.0F / 9.0F) - 2.0F / 3.0F) - cube * (40.0F / 81.0F);
    const Number slope = v * (10.0F / 9.0F) - 2.0F / 3.0F - pressed * v * (40.0F / 27.0F);
    const Number whole = shape + square * (1.0F / 3.0F - v * (4.0F / 27.0F)) + cube * v * (7.0F / 81.0F);
    const Number lacks = v * (2.0F / 3.0F - v * (4.0F / 9.0F)) + cube * (28.0F / 81.0F);
    const Number i = share * whole;
    return {i > 0.0F ? i : Number{}, share, v == change ? slope * whole + share * lacks : Number{}};
}

/// Least and largest stiffening b that a tissue may have: from -1/4 on more stretch is always more stress [-].
inline constexpr double minStiffening = -0.25;
inline constexpr double maxStiffening = 1000;

/// I up to which tissue with b < 0 softens; from there on its shear modulus stays what it is [-].
inline constexpr float softensTo = 1.0F;

/// How far a solver may carry force and energy on along the parabola that a step has shown, and not evaluate them again.
struct Reach {
    double further = 4.0;  // than the step itself, or its part [-]
    double off = 0.1;      // that the energy is from the parabola, fraction of what the step gains [-]
};

/// Hooke's law: strain is the symmetric gradient of the displacement, b means nothing.
struct SmallStrain {
    static constexpr std::string_view name = "linear";
    static constexpr bool finite = false;
    static constexpr Reach reach{};
    bool operator==(const SmallStrain&) const = default;
};

/// W = mu/2 I + mu/4 b I^2: neo-Hookean, and with b > 0 Yeoh's law with two terms, whose shear modulus goes as 1 + b I.
/// With b < 0 the second term goes on along its tangent from I = softensTo. Source: O. H. Yeoh, "Some forms of the strain
/// energy function for rubber", Rubber Chem. Technol. 66, 1993.
struct NeoHookean {
    static constexpr std::string_view name = "neo-hookean";
    static constexpr bool finite = true;
    static constexpr double work = 1.0;
    static constexpr Reach reach{};
    bool operator==(const NeoHookean&) const = default;

    /// @param mu  shear modulus at rest [any unit of stress or stiffness]
    /// @param b   stiffening [-]
    /// @param i   I, not under 0 [-]
    template <typename Number>
    [[gnu::always_inline]] static Stiffening<Number> beyond(Number mu, Number b, Number i) noexcept
    {
        const Number rise = b * mu;
        const Number bounded = i > softensTo ? Number{} + softensTo : i;
        const Number until = rise < 0.0F ? bounded : i;
        const Number slope = rise * until;
        return {0.25F * slope * (i + (i - until)), slope, until < i ? Number{} : rise};
    }
};

/// W = mu/(2 b) (exp(b I) - 1): the shear modulus goes as exp(b I), which is 1 + b I at first, up to exp(stiffensTo) = 55
/// times that at rest, and stays there. Sources: Y. C. Fung, "Elasticity of soft tissues in simple elongation", Am. J.
/// Physiol. 213, 1967; H. Demiray, "A note on the elasticity of soft biological tissues", J. Biomech. 5, 1972.
struct Exponential {
    static constexpr std::string_view name = "exponential";
    static constexpr bool finite = true;
    static constexpr double work = 1.1;
    static constexpr Reach reach{2.0, 0.02};   // what hostile hands found to be enough for any b (test ElasticHostile)
    static constexpr float stiffensTo = 4.0F;  // largest b I
    bool operator==(const Exponential&) const = default;

    /// As NeoHookean::beyond(). e^x - 1 = x h, h = 1 + x g: g by its series at x/8, doubled three times; so nothing is
    /// divided by b, and no small difference of large numbers is taken.
    template <typename Number>
    [[gnu::always_inline]] static Stiffening<Number> beyond(Number mu, Number b, Number i) noexcept
    {
        using Real = std::conditional_t<std::is_same_v<Number, double>, double, float>;
        constexpr Real c3 = Real(1) / 6, c4 = c3 / 4, c5 = c4 / 5, c6 = c5 / 6, c7 = c6 / 7, c8 = c7 / 8, c9 = c8 / 9;
        const Number last = b < 0.0F ? Number{} + softensTo : stiffensTo / b;
        const Number until = i > last ? last : i;
        const Number x = b * until;
        Number y = 0.125F * x;
        Number g = 0.5F + y * (c3 + y * (c4 + y * (c5 + y * (c6 + y * (c7 + y * (c8 + y * c9))))));
        Number h = 1.0F + y * g;
#pragma GCC unroll 3
        for (int doubled = 0; doubled < 3; ++doubled) {
            g = 0.25F * (h * h + 2.0F * g);
            y = 2.0F * y;
            h = 1.0F + y * g;
        }
        const Number rise = x * h;
        return {0.5F * mu * (until * x * g + (i - until) * rise), mu * rise, until < i ? Number{} : mu * b * (1.0F + rise)};
    }
};

/// A law of material. Small strain is one of its own; each other one is the neo-Hookean energy
/// mu/2 (J^(-2/3) I_C - 3) + K/2 (J - 1)^2, that of CalculiX, and what its beyond() adds. Its parameters are a tissue's
/// Young's modulus, Poisson's ratio and stiffening b (TissueRow). A new law is a struct as these, and a place at the end of
/// this list: scenes, the kernel, the reference and the planner go through it. `work` is what a node costs in a tick, in
/// neo-Hookean's, and `reach` how straight its stress is. The kernel's cells take I from isochoric().
using Law = std::variant<SmallStrain, NeoHookean, Exponential>;
inline constexpr std::size_t lawCount = std::variant_size_v<Law>;

/// Where a law stands in that list.
template <typename Of>
inline constexpr std::size_t lawIndex = Law(Of{}).index();

/// All of them, in the list's order.
inline constexpr std::array<Law, lawCount> laws = []<std::size_t... I>(std::index_sequence<I...>)
{
    return std::array<Law, lawCount>{Law(std::in_place_index<I>)...};
}
(std::make_index_sequence<lawCount>{});

constexpr bool isSmall(const Law& law) noexcept
{
    return law.index() == lawIndex<SmallStrain>;
}

/// As scenes, references and `--json` call it.
constexpr std::string_view nameOf(const Law& law) noexcept
{
    return std::visit([](auto of) { return of.name; }, law);
}

/// The names of all, in the list's order.
inline constexpr std::array<std::string_view, lawCount> lawNames = [] {
    std::array<std::string_view, lawCount> names{};
    for (std::size_t i = 0; i < lawCount; ++i) {
        names[i] = nameOf(laws[i]);
    }
    return names;
}();

/// The law of that name, or nothing.
constexpr std::optional<Law> lawNamed(std::string_view name) noexcept
{
    const auto at = std::ranges::find(lawNames, name);
    return at == lawNames.end() ? std::nullopt : std::optional(laws[static_cast<std::size_t>(at - lawNames.begin())]);
}

constexpr Reach reachOf(const Law& law) noexcept
{
    return std::visit([](auto of) { return of.reach; }, law);
}

/// The law, or where it is small strain, neo-Hookean.
constexpr Law finiteOf(const Law& law) noexcept
{
    return isSmall(law) ? Law(NeoHookean{}) : law;
}

/// What a law of finite strain has beyond neo-Hookean's, see Stiffening; of small strain nothing.
inline Stiffening<double> beyond(const Law& law, double mu, double b, double i) noexcept
{
    return std::visit(
        [&](auto of) -> Stiffening<double> {
            if constexpr (decltype(of)::finite) {
                return of.beyond(mu, b, i);
            } else {
                return {};
            }
        },
        law);
}

}  // namespace palpate::volume
