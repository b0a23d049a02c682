#include <reference/tissue_terms.h>

#include <fmt/format.h>
#include <getfem/getfem_generic_assembly.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <limits>
#include <utility>

namespace palpate::reference {

namespace {

// Nothing is derived by b, but GetFEM asks for a name.
constexpr const char* byStiffening = "law_by_stiffening";

// What a law has beyond neo-Hookean's energy, twice and of mu = 1, as functions of I and b of which GetFEM knows the
// derivatives by I.
template <typename Of>
void defineLaw()
{
    if constexpr (Of::finite) {
        static constexpr auto at = [](double i, double b) { return Of::beyond(1.0, b, i < 0.0 ? 0.0 : i); };
        const auto name = [](const char* what) { return fmt::format("law{}{}", volume::lawIndex<Of>, what); };
        getfem::ga_define_function(name("curvature"), [](double i, double b) { return at(i, b).curvature; });
        getfem::ga_define_function(
            name("slope"), [](double i, double b) { return at(i, b).slope; }, name("curvature"), byStiffening);
        getfem::ga_define_function(
            name("energy"), [](double i, double b) { return 2.0 * at(i, b).energy; }, name("slope"), byStiffening);
    }
}

}  // namespace

void defineLaws()
{
    static const bool defined = []<std::size_t... I>(std::index_sequence<I...>)
    {
        getfem::ga_define_function(byStiffening, [](double, double) { return std::numeric_limits<double>::quiet_NaN(); });
        (defineLaw<std::variant_alternative_t<I, Law>>(), ...);
        return true;
    }
    (std::make_index_sequence<volume::lawCount>());
    static_cast<void>(defined);
}

std::string tissueEnergy(const SolveOptions& options, bool stiffens)
{
    const bool linear = volume::isSmall(options.law);
    const std::string volume = linear ? "Trace(Grad_u)" : "(Det(F)-1)";
    const std::string shape = linear     ? "mu*Norm_sqr(Deviator(Sym(Grad_u)))"
                              : stiffens ? fmt::format("mu/2*(I+law{}energy(I,b))", options.law.index())
                                         : "mu/2*I";
    return shape + (options.elements == Elements::p2p1 ? "+p*" + volume + "-sqr(p)/(2*K)" : "+K/2*sqr(" + volume + ")");
}

std::string testedStress(const SolveOptions& options, bool stiffens)
{
    const bool linear = volume::isSmall(options.law);
    const std::string pressure = options.elements == Elements::p2p1 ? "p" : linear ? "K*Trace(Grad_u)" : "K*(Det(F)-1)";
    const std::string rise = stiffens ? fmt::format("(1+law{}slope(I,b))*", options.law.index()) : "";
    const std::string shape = linear ? "2*mu*Deviator(Sym(Grad_u))" : "mu*" + rise + "pow(Det(F),-5/3)*Deviator(F*F')";
    return "(" + shape + "+" + pressure + "*Id(3)):Test_s";
}

Vec3 Obstacle::fractions() const noexcept
{
    const double square = glm::dot(shaft, shaft);
    return square > 0.0 ? shaft / square : Vec3(0.0);
}

double Obstacle::distance(Vec3 p) const noexcept
{
    const double fraction = std::clamp(glm::dot(p - centre, fractions()), 0.0, 1.0);
    return glm::distance(p, centre + fraction * shaft) - radius;
}

}  // namespace palpate::reference
