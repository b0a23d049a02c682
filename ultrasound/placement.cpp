#include <ultrasound/placement.h>

#include <base/units.h>
#include <channel/deformation.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

namespace palpate::ultrasound {

namespace {

using units::degree;
constexpr double step = 0.25e-3;     // of a search for the skin [m]
constexpr double below = 8e-3;       // that a picture has below the aim, at least [m]
constexpr double standOff = 0.3e-3;  // gel between face and skin where they are nearest [m]

enum class Place : std::uint8_t { body, air, beyond };

Place placeAt(const Medium& medium, glm::dvec3 p)
{
    const std::uint8_t label = medium.label(glm::vec3((p - medium.origin()) / medium.spacing()));
    return label == unknown ? Place::beyond : (label & compared) == 0 ? Place::air : Place::body;
}

// From inside the body along `way` to the air; nothing where the labels end before.
std::optional<double> wayToAir(const Medium& medium, glm::dvec3 from, glm::dvec3 way)
{
    constexpr double farthest = 0.3;  // [m]
    for (double t = 0; t < farthest; t += step) {
        const Place place = placeAt(medium, from + t * way);
        if (place == Place::beyond)
            return std::nullopt;
        if (place == Place::air)
            return t;
    }
    return std::nullopt;
}

constexpr int directions = 200;  // evenly to all sides

glm::dvec3 directionAt(int i)
{
    const double z = 1 - (2.0 * i + 1) / directions, r = std::sqrt(1 - z * z), turn = 2.39996323 * i;
    return {r * std::cos(turn), r * std::sin(turn), z};
}

// No nearer than this is the skin to a point in the body: a picture that is less deep does not have it.
double nearestSkin(const Medium& medium, glm::dvec3 from)
{
    constexpr double between = 0.95;  // the cosine from the nearest direction that is looked along
    double nearest = 1;               // [m]
    for (int i = 0; i < directions; ++i)
        nearest = std::min(nearest, wayToAir(medium, from, directionAt(i)).value_or(nearest));
    return between * nearest;
}

// Out of the body at a point of its surface: the mean direction to the air around.
glm::dvec3 outward(const Medium& medium, glm::dvec3 p)
{
    constexpr double radius = 8e-3;  // [m]
    glm::dvec3 sum(0);
    for (int i = 0; i < directions; ++i) {
        const glm::dvec3 d = directionAt(i);
        if (placeAt(medium, p + radius * d) != Place::body)
            sum += d;
    }
    return sum;
}

struct Candidate {
    Pose pose;
    double score = std::numeric_limits<double>::max();
};

struct Line {
    glm::dvec3 entry, aim, along;
};

// Moves the face onto the skin; returns the mean gap, or nothing where the face hangs in the air or would be inside the
// body.
std::optional<double> lay(const Medium& medium, const Beam& beam, Pose& pose)
{
    constexpr int points = 9;
    constexpr double search = 30e-3, most = 5e-3;  // [m]
    const double half =
        beam.curved() ? beam.transducer().radius * std::sin(0.5 * beam.transducer().sector) : 0.5 * beam.transducer().width;
    std::array<double, points> gap{};
    for (int i = 0; i < points; ++i) {
        const double l = half * (2.0 * i / (points - 1) - 1);
        const double above = beam.curved() ? std::sqrt(beam.transducer().radius * beam.transducer().radius - l * l) -
                                                 beam.transducer().radius
                                           : 0.0;
        const glm::dvec3 face = pose.face + l * pose.lateral + above * pose.axial;
        double t = -search;
        if (placeAt(medium, face + t * pose.axial) == Place::body)
            return std::nullopt;
        while (t < search && placeAt(medium, face + t * pose.axial) != Place::body)
            t += step;
        gap[static_cast<std::size_t>(i)] = t;
    }
    const double nearest = *std::min_element(gap.begin(), gap.end());
    if (nearest >= search)
        return std::nullopt;
    pose.face += (nearest - standOff) * pose.axial;
    double sum = 0;
    int hanging = 0;
    for (const double g : gap) {
        sum += std::min(g - nearest, search);
        hanging += g - nearest > most ? 1 : 0;
    }
    // A curved face is pressed in by as much as it stands out.
    return hanging > (beam.curved() ? points : 2) ? std::nullopt : std::optional(sum / points);
}

double scoreOf(const Beam& beam, const Pose& pose, const Line& line, double gap)
{
    const auto local = [&](glm::dvec3 p) {
        return glm::dvec3(glm::dot(p - pose.face, pose.lateral), 0, glm::dot(p - pose.face, pose.axial));
    };
    const glm::dvec3 aim = local(line.aim);
    constexpr double least = 6e-3;  // [m]
    const glm::vec2 place = beam.place(static_cast<float>(aim.x), static_cast<float>(aim.z));
    const double side = std::abs(place.x) / (0.5 * (beam.curved() ? beam.transducer().sector : beam.transducer().width));
    if (place.y < least || place.y > static_cast<double>(beam.settings().depth) - below || side > 0.8)
        return std::numeric_limits<double>::max();
    // The needle's shaft outside must not go through the probe.
    const double half = beam.curved() ? 30e-3 : 0.5 * beam.transducer().width;
    double blocked = 0;
    for (double t = -0.1; t <= 0; t += 1e-3) {
        const glm::dvec3 p = local(line.entry + t * line.along);
        if (p.z < 2e-3 && std::abs(p.x) < half + 3e-3)
            blocked = 60;
    }
    const double oblique = std::asin(std::min(1.0, std::abs(glm::dot(line.along, pose.axial)))) / degree;
    return oblique + 500 * place.y + 10 * side + 5e3 * gap + blocked;
}

// Fraction of the picture that lies beyond what is known of the body.
double unknownShare(const Medium& medium, const Beam& beam, const Pose& pose)
{
    constexpr int points = 12;
    int beyond = 0;
    for (int i = 0; i < points; ++i)
        for (int k = 0; k < points; ++k) {
            const float line = (static_cast<float>(i) + 0.5F) / points * static_cast<float>(beam.settings().lines);
            const float depth = (static_cast<float>(k) + 0.5F) / points * beam.settings().depth;
            const glm::dvec3 p(beam.point(beam.lineAt(line), 0, depth));
            const glm::dvec3 at = pose.face + p.x * pose.lateral + p.z * pose.axial;
            beyond += placeAt(medium, at) == Place::beyond ? 1 : 0;
        }
    return static_cast<double>(beyond) / (points * points);
}

// The middle of the body and the way to its front.
Line standardLine(const Medium& medium)
{
    const glm::dvec3 middle = medium.origin() + 0.5 * medium.spacing() * glm::dvec3(medium.size());
    const glm::dvec3 along(0, 1, 0);
    const double t = wayToAir(medium, middle, -along).value_or(0);
    return {middle - t * along, middle - std::max(t - 20e-3, 0.0) * along, along};
}

Line lineOf(const Medium& medium, glm::dvec3 entry, glm::dvec3 aim)
{
    const bool planned = glm::distance(entry, aim) > 1e-4;
    return planned ? Line{entry, aim, glm::normalize(aim - entry)} : standardLine(medium);
}

// Across a line.
glm::dvec3 besideOf(const Line& line)
{
    const glm::dvec3 helper = std::abs(line.along.z) < 0.8 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
    return glm::normalize(glm::cross(line.along, helper));
}

}  // namespace

std::optional<Pose> placeProbe(const Medium& medium, const Beam& beam, glm::dvec3 entry, glm::dvec3 aim)
{
    const Line line = lineOf(medium, entry, aim);
    const glm::dvec3 a = besideOf(line), b = glm::cross(line.along, a);
    Candidate best;
    constexpr int turns = 24;
    for (int turn = 0; turn < turns; ++turn)
        for (double lean = 10; lean <= 80; lean += 5) {
            const double phi = 2 * std::numbers::pi * turn / turns;
            const glm::dvec3 across = std::cos(phi) * a + std::sin(phi) * b;
            const glm::dvec3 up = -std::cos(lean * degree) * line.along + std::sin(lean * degree) * across;
            const auto way = wayToAir(medium, line.aim, up);
            if (!way)
                continue;
            const glm::dvec3 skin = line.aim + *way * up, normal = glm::cross(line.along, across);
            glm::dvec3 out = outward(medium, skin);
            if (!(glm::length(out) > 0))
                continue;
            out = glm::normalize(out);
            constexpr double leaning = 0.35;  // of the skin out of the picture's plane
            if (std::abs(glm::dot(out, normal)) > leaning)
                continue;
            const glm::dvec3 axial = glm::normalize(glm::dot(out, normal) * normal - out);
            Pose pose = poseOf(skin, axial, glm::cross(normal, axial));
            if (glm::dot(line.entry - skin, pose.lateral) < 0)
                pose = poseOf(skin, axial, -pose.lateral);
            const auto gap = lay(medium, beam, pose);
            double score = gap ? scoreOf(beam, pose, line, *gap) : best.score;
            constexpr double empty = 200;  // worth two thirds of a right angle where a third is empty
            if (score < best.score)
                score += empty * unknownShare(medium, beam, pose);
            if (score < best.score)
                best = {pose, score};
        }
    return best.score < std::numeric_limits<double>::max() ? std::optional(best.pose) : std::nullopt;
}

namespace {

// What the scene says of the scanner, if anything.
Examination examinationWith(const Transducer& transducer, const channel::Scenery& scenery)
{
    Examination e;
    e.held = scenery.probe != channel::ProbeKind::none;
    e.transducer = transducer;
    e.settings = settingsOf(transducer);
    if (scenery.probeDepth > 0)
        e.settings.depth = static_cast<float>(scenery.probeDepth);
    if (scenery.probeFrequency > 0)
        e.settings.frequency = static_cast<float>(scenery.probeFrequency);
    if (scenery.probeFocus > 0)
        e.settings.focus = static_cast<float>(scenery.probeFocus);
    e.settings = within(e.settings, e.transducer);
    return e;
}

}  // namespace

Examination examinationOf(const channel::Scenery& scenery, const Medium& medium)
{
    if (scenery.probe != channel::ProbeKind::none)
        return examinationWith(scenery.probe == channel::ProbeKind::curved ? curvedProbe() : linearProbe(), scenery);
    constexpr double deep = 45e-3;                        // along the line [m]
    constexpr std::array<float, 2> more{50e-3F, 60e-3F};  // of the linear probe's picture [m]
    const glm::dvec3 entry = channel::vec(scenery.entry), aim = channel::vec(scenery.aim);
    const Line line = lineOf(medium, entry, aim);
    std::vector<Examination> tries{examinationWith(linearProbe(), scenery)};
    for (const float depth : more) {
        tries.push_back(tries.front());
        tries.back().settings.depth = depth;
    }
    const bool curvedFirst = glm::distance(line.entry, line.aim) > deep;
    tries.insert(curvedFirst ? tries.begin() : tries.end(), examinationWith(curvedProbe(), scenery));
    const double skin = nearestSkin(medium, line.aim);
    for (Examination& e : tries) {
        if (skin > static_cast<double>(e.settings.depth) - below)
            continue;
        if (const auto pose = placeProbe(medium, Beam(e.transducer, e.settings), entry, aim)) {
            e.pose = *pose;
            return e;
        }
    }
    Examination& e = tries.front();
    e.pose = poseOf(line.entry, line.along, besideOf(line));
    lay(medium, Beam(e.transducer, e.settings), e.pose);
    return e;
}

ProbeMove& ProbeMove::operator+=(const ProbeMove& more) noexcept
{
    slide += more.slide;
    sweep += more.sweep;
    rock += more.rock;
    turn += more.turn;
    press += more.press;
    tilt += more.tilt;
    return *this;
}

Pose movedOnSkin(const Medium& medium, const Examination& examination, const ProbeMove& move)
{
    const Pose& from = examination.pose;
    const glm::dvec3 fanned = std::cos(move.tilt) * from.axial + std::sin(move.tilt) * from.elevation;
    const glm::dvec3 axial = std::cos(move.rock) * fanned + std::sin(move.rock) * from.lateral;
    const glm::dvec3 lateral = std::cos(move.turn) * from.lateral + std::sin(move.turn) * from.elevation;
    Pose to = poseOf(from.face + move.slide * from.lateral + move.sweep * from.elevation, axial, lateral);
    return lay(medium, Beam(examination.transducer, examination.settings), to) ? to : from;
}

Pose poseAt(const Examination& examination, const channel::State& state)
{
    if (!examination.held)
        return examination.pose;
    return poseOf(channel::vec(state.probe.face), channel::vec(state.probe.axial), channel::vec(state.probe.lateral));
}

}  // namespace palpate::ultrasound
