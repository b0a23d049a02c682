#include <base/error.h>
#include <base/mapped.h>
#include <base/units.h>
#include <datasets/scene.h>
#include <datasets/scene_text.h>
#include <datasets/toml_fields.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

namespace palpate::datasets {

namespace {

constexpr std::size_t maxProbeSteps = 1000;

// As the transducers of ultrasound/transducer.h have them; a test compares.
using ProbeFields = std::array<Field<ProbeSpec>, 3>;
constexpr ProbeFields linearFields{{
    {"depth_mm", "mm", 20, 80, 1e-3, &ProbeSpec::depth},
    {"frequency_mhz", "MHz", 5, 14, 1e6, &ProbeSpec::frequency},
    {"focus_mm", "mm", 5, 80, 1e-3, &ProbeSpec::focus},
}};
constexpr ProbeFields curvedFields{{
    {"depth_mm", "mm", 60, 200, 1e-3, &ProbeSpec::depth},
    {"frequency_mhz", "MHz", 2, 6, 1e6, &ProbeSpec::frequency},
    {"focus_mm", "mm", 10, 200, 1e-3, &ProbeSpec::focus},
}};
constexpr double linearDepth = 40e-3, curvedDepth = 140e-3;  // their own [m]

const ProbeFields& fieldsOf(const ProbeSpec& probe)
{
    return probe.kind == ProbeKind::curved ? curvedFields : linearFields;
}

using units::degree;
constexpr std::array<Field<ProbeStep>, 7> probeStepFields{{
    {"at_s", "s", 0, 86400, 1, &ProbeStep::time},
    {"press_mm", "mm", -50, 50, 1e-3, &ProbeStep::press},
    {"slide_mm", "mm", -200, 200, 1e-3, &ProbeStep::slide},
    {"sweep_mm", "mm", -200, 200, 1e-3, &ProbeStep::sweep},
    {"rock_deg", "deg", -80, 80, degree, &ProbeStep::rock},
    {"tilt_deg", "deg", -80, 80, degree, &ProbeStep::tilt},
    {"turn_deg", "deg", -180, 180, degree, &ProbeStep::turn},
}};

// Any length but 0, given as three numbers; the unit vector.
Vec3 readDirection(Section& section, std::string_view key)
{
    const auto direction = section.direction(key, farthestCoordinate);
    section.missingIf(!direction, key, "a direction [x, y, z] in the patient frame LPS");
    return *direction;
}

std::string triple(Vec3 v)
{
    return fmt::format("[{:.12g}, {:.12g}, {:.12g}]", v.x, v.y, v.z);
}

void readPlace(Section& section, ProbeSpec& probe)
{
    const auto face = section.point("face_mm", farthestCoordinate);
    section.missingIf(!face, "face_mm", "the middle of the probe's face: [x, y, z] in mm, or over_target = true");
    probe.face = *face;
    probe.direction = readDirection(section, "direction");
    probe.lateral = readDirection(section, "lateral");
    const Vec3 across = probe.lateral - glm::dot(probe.lateral, probe.direction) * probe.direction;
    constexpr double least = 0.2;
    section.refuseIf(glm::length(across) < least, "lateral", "must not be along direction");
    probe.lateral = glm::normalize(across);
}

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
    section.refuseIf(section.has(named) && section.has(directed), directed, fmt::format("{} says it already", named));
    if (const auto index = section.choice(named, names)) {
        return patientPostures[*index].down;
    }
    const auto direction = section.direction(directed, largest);
    section.missingIf(!direction, named, fmt::format("{}; or {}, [x, y, z]", fmt::join(names, ", "), directed));
    return *direction;
}

std::string downText(std::string_view named, std::string_view directed, Vec3 down)
{
    const auto posture = std::ranges::find(patientPostures, down, &PatientPosture::down);
    return posture != std::end(patientPostures)
               ? fmt::format("{} = \"{}\"\n", named, posture->name)
               : fmt::format("{} = [{:.12g}, {:.12g}, {:.12g}]\n", directed, down.x, down.y, down.z);
}

struct Setting {
    std::string_view name;
    double spacing;  // [m]
    int window;
    int cycles;
};

constexpr ElasticSettings standard;
constexpr std::array<Setting, 3> settings{{
    {"fast", 4e-3, 9, 1},
    {"default", standard.spacing, standard.window, standard.cycles},
    {"fine", 1.5e-3, 19, 2},
}};

}  // namespace

void readProbe(Section& top, ProbeSpec& probe)
{
    if (std::optional<Section> section = top.section("probe")) {
        const auto kind = section->choice("kind", std::span(probeKinds).subspan(1));
        section->missingIf(!kind, "kind", "linear or curved");
        probe.kind = static_cast<ProbeKind>(*kind + 1);
        probe.overTarget = section->flag("over_target").value_or(false);
        if (!probe.overTarget) {
            readPlace(*section, probe);
        }
        readFields<ProbeSpec>(*section, fieldsOf(probe), probe, Need::some);
        const double own = probe.kind == ProbeKind::curved ? curvedDepth : linearDepth,
                     depth = probe.depth > 0 ? probe.depth : own;
        section->refuseIf(probe.focus > depth, "focus_mm",
                          fmt::format("must not be deeper than the picture, {:g} mm", 1e3 * depth), "mm");
        section->refuseIf(probe.focus > 0 && probe.focus < 0.1 * depth, "focus_mm",
                          fmt::format("must be at least a tenth of the picture's depth, {:g} mm", 1e2 * depth), "mm");
        section->finish();
    }
    for (Section& section : top.sections("probe_step")) {
        section.refuseIf(probe.kind == ProbeKind::none, "at_s", "a step of a probe needs a [probe]");
        ProbeStep step;
        section.missingIf(!section.has("at_s"), "at_s", "when the probe is there [s]");
        readFields<ProbeStep>(section, probeStepFields, step, Need::some);
        section.refuseIf(!probe.script.empty() && step.time <= probe.script.back().time, "at_s",
                         "must be later than the step before", "s");
        section.finish();
        probe.script.push_back(step);
        section.refuseIf(probe.script.size() > maxProbeSteps, "at_s", fmt::format("over {} steps", maxProbeSteps));
    }
}

std::string probeText(const ProbeSpec& probe)
{
    if (probe.kind == ProbeKind::none) {
        return {};
    }
    std::string out = fmt::format("\n[probe]\nkind = \"{}\"\n", probeKinds[static_cast<std::size_t>(probe.kind)]);
    out += probe.overTarget ? "over_target = true\n"
                            : fmt::format("face_mm = {}\ndirection = {}\nlateral = {}\n", triple(1e3 * probe.face),
                                          triple(probe.direction), triple(probe.lateral));
    out += probe.depth > 0 ? fmt::format("depth_mm = {:.12g}\n", 1e3 * probe.depth) : "";
    out += probe.frequency > 0 ? fmt::format("frequency_mhz = {:.12g}\n", 1e-6 * probe.frequency) : "";
    out += probe.focus > 0 ? fmt::format("focus_mm = {:.12g}\n", 1e3 * probe.focus) : "";
    for (const ProbeStep& step : probe.script) {
        out += "\n[[probe_step]]\n" + writeFields<ProbeStep>(probeStepFields, step);
    }
    return out;
}

ProbeMove operator+(const ProbeMove& a, const ProbeMove& b) noexcept
{
    return {a.press + b.press, a.slide + b.slide, a.sweep + b.sweep, a.rock + b.rock, a.tilt + b.tilt, a.turn + b.turn};
}

ProbeMove scriptedMove(const ProbeSpec& probe, double time) noexcept
{
    if (probe.script.empty()) {
        return {};
    }
    std::size_t next = 0;
    while (next < probe.script.size() && probe.script[next].time <= time) {
        ++next;
    }
    const ProbeStep start;  // where it begins, at time 0
    const ProbeStep& from = next > 0 ? probe.script[next - 1] : start;
    const ProbeStep& to = next < probe.script.size() ? probe.script[next] : probe.script.back();
    const double span = to.time - from.time, t = span > 0 ? (time - from.time) / span : 0.0;
    const auto between = [&](double ProbeStep::*m) { return from.*m + t * (to.*m - from.*m); };
    return {between(&ProbeStep::press), between(&ProbeStep::slide), between(&ProbeStep::sweep),
            between(&ProbeStep::rock),  between(&ProbeStep::tilt),  between(&ProbeStep::turn)};
}

ProbePlace probeAfter(const ProbeSpec& probe, const ProbeMove& move) noexcept
{
    const Vec3 across = glm::cross(probe.direction, probe.lateral);
    ProbePlace place;
    place.face = probe.face + move.press * probe.direction + move.slide * probe.lateral + move.sweep * across;
    const double ct = std::cos(move.turn), st = std::sin(move.turn);
    const Vec3 lateral = ct * probe.lateral + st * across;
    const Vec3 elevation = ct * across - st * probe.lateral;
    const Vec3 direction = std::cos(move.tilt) * probe.direction + std::sin(move.tilt) * elevation;
    const double c = std::cos(move.rock), s = std::sin(move.rock);
    place.direction = c * direction + s * lateral;
    place.lateral = c * lateral - s * direction;
    return place;
}

constexpr int maxSlices = 9;
constexpr int usualSlices = 3;

constexpr std::array<Field<CtSpec>, 2> ctFields{{
    {"slice_mm", "mm", 0.5, 20, 1e-3, &CtSpec::width},
    {"ctdi_mgy", "mGy", 0.1, 100, 1, &CtSpec::doseIndex},
}};

void readCt(Section& top, CtSpec& ct)
{
    if (std::optional<Section> section = top.section("ct")) {
        ct.slices = static_cast<int>(section->integer("slices", "", 1, maxSlices).value_or(usualSlices));
        section->refuseIf(ct.slices % 2 == 0, "slices", "must be odd: the middle one goes through the tip");
        readFields<CtSpec>(*section, ctFields, ct, Need::some);
        section->finish();
    }
}

std::string ctText(const CtSpec& ct)
{
    return ct.given() ? fmt::format("\n[ct]\nslices = {}\n{}", ct.slices, writeFields<CtSpec>(ctFields, ct))
                      : std::string();
}

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

std::vector<std::string> elasticSettings()
{
    return base::mapped<std::string>(settings, &Setting::name);
}

ElasticSettings elasticSetting(const std::string& name, const ElasticSettings& base)
{
    for (const Setting& setting : settings) {
        if (name == setting.name) {
            ElasticSettings out = base;
            out.spacing = setting.spacing;
            out.window = setting.window;
            out.cycles = setting.cycles;
            return out;
        }
    }
    throw base::error("setting '{}': there is none; there are {}", name, fmt::join(elasticSettings(), ", "));
}

}  // namespace palpate::datasets
