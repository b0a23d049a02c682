#include <studies/kernel/trial_path.h>

#include <base/error.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::studies {

namespace {

constexpr double tick = 1e-3;       // [s]
constexpr double step = 0.25e-3;    // along a line through the tissue [m]
constexpr double deepest = 0.3;     // of a line through the tissue [m]
constexpr double pressShare = 0.8;  // of a sphere's radius
constexpr double thickShare = 0.4;  // of the tissue's thickness
constexpr double gap = 0.5e-3;      // between a sphere and the surface at the start [m]
constexpr double tipDepth = 1e-3;   // of a needle's tip at the start [m]
constexpr double shaftLength = 20e-3;
constexpr double shaftRadius = 1.05e-3;  // of 14 G [m]
constexpr double tieStiffness = 8.0;     // in E h
constexpr int looks = 4;                 // in press and drag each
constexpr int turnLooks[] = {5, 20};     // ticks after the turn
constexpr int restTicks = 50;

// How far a line from the surface runs through tissue that gives way [m].
double softLength(const volume::Tissue& tissue, Vec3 from, Vec3 direction)
{
    const volume::Tissue::Reader reader(tissue);
    const auto& rows = tissue.table().rows;
    double t = 4.0 * step;  // the surface is somewhere in a voxel
    for (; t < deepest; t += step) {
        const auto& row = rows[reader.tissue(from + t * direction)];
        if (row.fixed || row.role == volume::Role::bone || row.role == volume::Role::air) {
            break;
        }
    }
    return t - 4.0 * step;
}

// A point, or a piece of a shaft.
void addTie(const volume::Tissue& tissue, Vec3 rest, double spacing, const chainmail::RodPiece& piece, TrialPath& path)
{
    const double stiffness = tieStiffness * volume::Tissue::Reader(tissue).youngsModulus(rest) * spacing;
    path.ties.push_back({rest, Vec3(0.0), path.inward, stiffness, stiffness, piece, path.inward});
}

// As many as the speed wants, but a multiple of the looks.
int ticksOf(double length, double speed)
{
    return looks * std::max(1, static_cast<int>(std::lround(length / (speed * tick * looks))));
}

}  // namespace

TrialPlace trialPlace(const volume::Tissue& tissue, const volume::DistanceField& surface, Vec3 entry, Vec3 aim)
{
    TrialPlace place;
    place.entry = entry;
    place.inward = -surface.normal(entry);
    place.approach = glm::distance(aim, entry) > 0.0 ? glm::normalize(aim - entry) : place.inward;
    const Vec3 left = std::abs(place.inward.x) < 0.9 ? Vec3(1, 0, 0) : Vec3(0, 0, 1);
    place.sideways = glm::normalize(left - glm::dot(left, place.inward) * place.inward);
    place.thickness = softLength(tissue, entry, place.inward);
    place.shaft = softLength(tissue, entry, place.approach);
    base::failIf(place.thickness <= 0.0 || place.shaft <= 0.0,
                 "entry at {:.1f}, {:.1f}, {:.1f} mm: there is no soft tissue to press under it", 1e3 * entry.x,
                 1e3 * entry.y, 1e3 * entry.z);
    return place;
}

std::vector<TrialTool> trialTools()
{
    return {{"sphere_5mm", TrialKind::sphere, 5e-3, 0.0},
            {"sphere_10mm", TrialKind::sphere, 10e-3, 0.0},
            {"needle", TrialKind::needle, 0.0, 0.0},
            {"shaft", TrialKind::shaft, 0.0, 0.0}};
}

TrialPath trialPath(const volume::Tissue& tissue, const volume::DistanceField& surface, const TrialPlace& place,
                    const TrialTool& tool, double spacing)
{
    TrialPath path;
    path.tool = tool;
    path.surface = &surface;
    if (tool.kind == TrialKind::sphere || tool.kind == TrialKind::capsule) {
        path.inward = place.inward;
        path.sideways = place.sideways;
        path.gap = gap;
        path.start = place.entry - (tool.radius + gap) * place.inward;
        path.press = gap + std::min(pressShare * tool.radius, thickShare * place.thickness);
        path.drag = 6e-3;
        return path;
    }
    const bool shaft = tool.kind == TrialKind::shaft;
    path.inward = place.approach;
    path.sideways = glm::normalize(place.sideways - glm::dot(place.sideways, place.approach) * place.approach);
    path.press = std::min(shaft ? 2e-3 : 5e-3, thickShare * place.shaft);
    path.drag = 3e-3;
    if (!shaft) {
        addTie(tissue, place.entry + std::min(tipDepth, 0.5 * place.shaft) * place.approach, spacing, {}, path);
    }
    const double length = shaft ? std::min(shaftLength, 0.8 * place.shaft) : 0.0;
    const double pieces = chainmail::piecesOfRod(length);
    for (double i = 0.5; shaft && i < pieces; ++i) {
        addTie(tissue, place.entry + i * length / pieces * place.approach, spacing, {shaftRadius, length / pieces, length},
               path);
    }
    path.start = path.ties.back().rest;
    return path;
}

std::vector<TrialTick> schedule(const TrialPath& path, double speed)
{
    const int in = ticksOf(path.press, speed);
    const int across = ticksOf(path.drag, speed);
    std::vector<TrialTick> ticks;
    for (int t = 1; t <= in; ++t) {
        ticks.push_back({{path.press * t / in, 0.0}, TrialPhase::press, t % (in / looks) == 0});
    }
    for (int t = 1; t <= across; ++t) {
        const bool turned = std::find(std::begin(turnLooks), std::end(turnLooks), t) != std::end(turnLooks);
        const bool look = t % (across / looks) == 0;
        ticks.push_back(
            {{path.press, path.drag * t / across}, turned ? TrialPhase::turn : TrialPhase::drag, turned || look});
    }
    for (int t = 1; t <= restTicks; ++t) {
        ticks.push_back({{path.press, path.drag}, TrialPhase::rest, t == restTicks});
    }
    return ticks;
}

TrialLoad::TrialLoad(const TrialPath& path) : path_(path), ties_(path.ties)
{
    if (ties_.empty()) {
        load_.tools = {&tool_, 1};
    }
    load_.ties = ties_;
    set({});
}

void TrialLoad::set(TrialPose pose) noexcept
{
    pose_ = pose;
    const Vec3 way = path_.way(pose);
    for (chainmail::Tie& tie : ties_) {
        tie.u = way;
    }
    if (!ties_.empty()) {
        load_.focus = chainmail::focusAt(*path_.surface, 0.5 * (ties_.front().rest + ties_.back().rest));
        return;
    }
    const Vec3 at = path_.start + way;
    const double radius = path_.tool.radius;
    tool_.shape = {at - path_.tool.length * path_.inward, at, radius, radius};
    tool_.pushed = std::max(pose.pressed - path_.gap, 0.0) * path_.inward;
    // The point of the surface at rest that is nearest to the tool's foremost one.
    const Vec3 foremost = at + radius * path_.inward;
    load_.focus =
        chainmail::focusAt(*path_.surface, foremost - path_.surface->distance(foremost) * path_.surface->normal(foremost));
}

}  // namespace palpate::studies
