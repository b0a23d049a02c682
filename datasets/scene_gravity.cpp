#include <datasets/scene_text.h>

#include <datasets/toml_fields.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>

namespace palpate::datasets {

namespace {

constexpr double largest = 5000;  // of a direction's numbers

constexpr std::array<Field<GravitySpec>, 2> gravityFields{{
    {"g_m_s2", "m/s^2", 0, 30, 1, &GravitySpec::strength},
    {"modulus", "", 0.001, 100, 1, &GravitySpec::modulus},
}};

// A posture by its name, or where things fall in it.
Vec3 readDown(Section& section, std::string_view named, std::string_view directed)
{
    std::array<std::string_view, patientPostures.size()> names;
    std::ranges::transform(patientPostures, names.begin(), &PatientPosture::name);
    if (section.has(named) && section.has(directed)) {
        section.refuse(directed, fmt::format("{} says it already", named));
    }
    if (const auto index = section.choice(named, names)) {
        return patientPostures[*index].down;
    }
    const auto direction = section.direction(directed, largest);
    if (!direction) {
        section.missing(named, fmt::format("{}; or {}, [x, y, z]", fmt::join(names, ", "), directed));
    }
    return *direction;
}

std::string downText(std::string_view named, std::string_view directed, Vec3 down)
{
    for (const PatientPosture& posture : patientPostures) {
        if (posture.down == down) {
            return fmt::format("{} = \"{}\"\n", named, posture.name);
        }
    }
    return fmt::format("{} = [{:.12g}, {:.12g}, {:.12g}]\n", directed, down.x, down.y, down.z);
}

}  // namespace

void readGravity(Section& top, GravitySpec& gravity)
{
    if (std::optional<Section> section = top.section("gravity")) {
        gravity.given = true;
        gravity.down = readDown(*section, "posture", "direction");
        gravity.shapeDown = readDown(*section, "shape", "shape_direction");
        readFields<GravitySpec>(*section, gravityFields, gravity, Need::some);
        section->finish();
    }
}

std::string gravityText(const GravitySpec& gravity)
{
    return gravity.given ? fmt::format("\n[gravity]\n{}{}{}", downText("posture", "direction", gravity.down),
                                       downText("shape", "shape_direction", gravity.shapeDown),
                                       writeFields<GravitySpec>(gravityFields, gravity))
                         : std::string();
}

}  // namespace palpate::datasets
