#include <base/error.h>
#include <base/mapped.h>
#include <datasets/approach.h>
#include <datasets/scene_text.h>
#include <datasets/voxel_obstacles.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <numbers>

namespace palpate::datasets {

namespace {

using volume::Box;
using volume::NodeGrid;
using volume::Role;
using volume::Structure;
using volume::Tissue;
using Labels = std::vector<std::uint16_t>;

constexpr std::size_t maxSamples = 2'000'000;   // of the search for the target
constexpr std::size_t maxFieldNodes = 300'000;  // of a distance field
constexpr int directionCount = 600;
constexpr int borderVoxels = 3;          // a surface with fewer voxels of air to the image's border is a cut, not skin
constexpr double freeOutside = 0.06;     // length of needle that must be in air before it enters [m]
constexpr double beyondTip = 3e-3;       // a line must also be clear so far beyond the fired tip [m]
constexpr double startDistance = 0.03;   // of the tip from the skin, before and after [m]
constexpr double minInside = 3e-3;       // the tip is so deep before the gun fires [m]
constexpr double steepest = 0.5;         // cosine between needle and skin's normal; flatter, the tip slips on the skin
constexpr double normalPatch = 5e-3;     // radius of the patch that tells the skin's normal [m]
constexpr double otherDirection = 0.94;  // cosine between two proposals, at most
constexpr double otherPlace = 10e-3;     // or so far are their aims apart [m]
constexpr double clearances[] = {4e-3, 2.5e-3, 1.5e-3};  // tried in this order, beside the needle's radius [m]

struct Blob {
    std::size_t nodes = 0;
    Box box;
};

Labels namedLabels(const Scene& scene, const Tissue& tissue)
{
    Labels labels = tissue.labelsNamed(scene.target);
    if (labels.empty()) {
        const auto names = base::mapped<std::string>(tissue.structures(), &Structure::name);
        throw base::error("{}: no structure '{}' in the volume; there are {}", scene.name, scene.target,
                          fmt::join(names, ", "));
    }
    return labels;
}

std::vector<char> samplesInside(const Tissue& tissue, const NodeGrid& grid, const Labels& labels)
{
    std::vector<char> inside(grid.count(), 0);
    std::vector<char> wanted(65536, 0);
    for (const std::uint16_t label : labels) {
        wanted[label] = 1;
    }
    tbb::parallel_for(tbb::blocked_range<int>(0, grid.size.z, 4), [&](const tbb::blocked_range<int>& slab) {
        const Tissue::Reader reader(tissue);
        for (int k = slab.begin(); k < slab.end(); ++k) {
            for (int j = 0; j < grid.size.y; ++j) {
                for (int i = 0; i < grid.size.x; ++i) {
                    inside[grid.offset({i, j, k})] = wanted[reader.label(grid.position({i, j, k}))];
                }
            }
        }
    });
    return inside;
}

// Unmarks the connected piece (faces) that `start` lies in.
Blob takeBlob(const NodeGrid& grid, std::vector<char>& marked, std::size_t start)
{
    Blob blob{0, {grid.position(grid.node(start)), grid.position(grid.node(start))}};
    std::vector<std::size_t> open{start};
    marked[start] = 0;
    while (!open.empty()) {
        const Index3 n = grid.node(open.back());
        open.pop_back();
        ++blob.nodes;
        blob.box = {glm::min(blob.box.low, grid.position(n)), glm::max(blob.box.high, grid.position(n))};
        for (int side = 0; side < 6; ++side) {
            Index3 next = n;
            next[side / 2] += side % 2 == 0 ? 1 : -1;
            if (grid.contains(next) && marked[grid.offset(next)] != 0) {
                marked[grid.offset(next)] = 0;
                open.push_back(grid.offset(next));
            }
        }
    }
    return blob;
}

// Connected pieces of the marked nodes, largest first; unmarks them.
std::vector<Blob> blobs(const NodeGrid& grid, std::vector<char>& marked)
{
    std::vector<Blob> out;
    for (std::size_t start = 0; start < marked.size(); ++start) {
        if (marked[start] != 0) {
            out.push_back(takeBlob(grid, marked, start));
        }
    }
    std::stable_sort(out.begin(), out.end(), [](const Blob& a, const Blob& b) { return a.nodes > b.nodes; });
    return out;
}

Vec3 deepestPoint(const Tissue& tissue, const Labels& labels, const Box& box, double step)
{
    const Vec3 extent = box.high - box.low;
    const double wanted = std::max(step / 2, std::max({extent.x, extent.y, extent.z}) / 32);
    const NodeGrid grid = volume::coveringGrid(box, volume::affordableSpacing(box, wanted, step, maxFieldNodes), step);
    const volume::DistanceField field = tissue.distanceTo(labels, grid);
    const auto deepest = std::min_element(field.values.begin(), field.values.end());
    return grid.position(grid.node(static_cast<std::size_t>(deepest - field.values.begin())));
}

// Points to aim at: inside the target's largest piece, or inside a few of the largest when it is scattered.
std::vector<Vec3> aims(const Scene& scene, const Tissue& tissue)
{
    if (scene.aim) {
        return {*scene.aim};
    }
    constexpr std::size_t maxBlobs = 12;
    const Labels labels = namedLabels(scene, tissue);
    const Vec3 voxel = tissue.affine().spacing();
    const Box body = tissue.box();
    const double step = volume::affordableSpacing(body, std::max({voxel.x, voxel.y, voxel.z}), 0, maxSamples);
    const NodeGrid grid = volume::coveringGrid(body, step, 0);
    std::vector<char> inside = samplesInside(tissue, grid, labels);
    const std::vector<Blob> pieces = blobs(grid, inside);
    if (pieces.empty()) {  // smaller than the sampling
        return {deepestPoint(tissue, labels, body, step)};
    }
    std::vector<Vec3> points;
    for (const Blob& piece : pieces) {
        if (points.size() < maxBlobs && 4 * piece.nodes >= pieces.front().nodes) {
            points.push_back(deepestPoint(tissue, labels, piece.box, step));
        }
    }
    return points;
}

/// What the search for a line asks of the volume.
struct Surroundings {
    const Tissue& tissue;
    VoxelObstacles obstacles;  // vital, bone and fixed tissue
    WayJudge judge;
    bool hasSkin = false;
    double step = 0;   // along a line [m]
    double reach = 0;  // no line inside the body is longer [m]
};

Surroundings surroundings(const Scene& scene, const Tissue& tissue)
{
    const volume::TissueTable& table = tissue.table();
    std::vector<char> forbidden(65536, 0);
    bool hasSkin = false;
    for (const Structure& structure : tissue.structures()) {
        const volume::TissueRow& row = table.rows[structure.tissue];
        hasSkin = hasSkin || row.role == Role::skin;
        forbidden[structure.value] = row.role == Role::vital || row.role == Role::bone || row.fixed ? 1 : 0;
    }
    for (const VitalStructure& vital : scene.vital) {
        for (const std::uint16_t label : tissue.labelsNamed(vital.name)) {
            forbidden[label] = 1;
        }
    }
    for (const std::uint16_t label : scene.target.empty() ? Labels{} : tissue.labelsNamed(scene.target)) {
        forbidden[label] = 0;
    }
    Surroundings s{tissue, VoxelObstacles(tissue, forbidden), WayJudge(scene, tissue), hasSkin};
    const Box body = tissue.box();
    const Vec3 voxel = tissue.affine().spacing();
    s.step = std::clamp(std::min({voxel.x, voxel.y, voxel.z}) / 2, 0.2e-3, 1e-3);
    s.reach = glm::length(body.high - body.low);
    return s;
}

bool outside(const Surroundings& s, const Tissue::Reader& reader, Vec3 p)
{
    return s.tissue.table().rows[reader.tissue(p)].role == Role::air;
}

bool nearBorder(const Tissue& tissue, Vec3 p)
{
    const Vec3 index = tissue.affine().toIndex(p);
    const double nearest = borderVoxels - 0.5;  // the face of the first voxel behind those of air
    const Vec3 farthest = Vec3(tissue.size() - 1) - nearest;
    return glm::any(glm::lessThan(index, Vec3(nearest))) || glm::any(glm::greaterThan(index, farthest));
}

/// Where a way leaves the body for good.
struct Exit {
    std::optional<Vec3> point;  // nothing: no place to enter
    bool atBorder = false;      // of the image, which may cut the body there
};

Exit exitPoint(const Surroundings& s, const Tissue::Reader& reader, Vec3 aim, Vec3 direction)
{
    double inside = 0;
    for (double t = 0; t < s.reach && t < inside + freeOutside; t += s.step) {
        inside = outside(s, reader, aim + t * direction) ? inside : t;
    }
    double beyond = inside + s.step;
    const Vec3 last = aim + inside * direction;
    if (outside(s, reader, last)) {
        return {};
    }
    if (nearBorder(s.tissue, last)) {
        return {{}, true};
    }
    if (s.hasSkin && s.tissue.table().rows[reader.tissue(last)].role != Role::skin) {
        return {};
    }
    for (int halving = 0; halving < 8; ++halving) {
        const double middle = (inside + beyond) / 2;
        (outside(s, reader, aim + middle * direction) ? beyond : inside) = middle;
    }
    return {aim + beyond * direction};
}

// Unit vector out of the body around `p` on its surface: from the middle of what is tissue to the middle of what is air.
Vec3 skinNormal(const Surroundings& s, const Tissue::Reader& reader, Vec3 p)
{
    constexpr int half = 5;
    Vec3 sum(0.0);
    volume::forEachIndex(Index3(-half), Index3(half), [&](Index3 n) {
        const Vec3 away = normalPatch / half * Vec3(n);
        if (glm::length(away) <= normalPatch) {
            sum += outside(s, reader, p + away) ? away : -away;
        }
    });
    const double length = glm::length(sum);
    return length > 0 ? sum / length : Vec3(0.0);
}

struct Line {
    Proposal way;
    double cost = 0;
};

double throwOf(const ToolSpec& tool)
{
    return tool.kind == ToolKind::needle ? tool.throwLength : 0.0;
}
double halfNotch(const ToolSpec& tool)
{
    return tool.kind == ToolKind::needle ? tool.notchLength / 2 : 0.0;
}

static_assert(borderVoxels == 3);
constexpr const char* cutOff = "out within 3 voxels of the volume's border, where it may cut the body";

// The way into `aim` along -`direction`, if there is one, or with a refusal.
std::optional<Line> lineAlong(const Scene& scene, const Surroundings& s, const Tissue::Reader& reader, Vec3 aim,
                              Vec3 direction)
{
    const auto [entry, atBorder] = exitPoint(s, reader, aim, direction);
    if (atBorder) {
        Line cut;
        cut.way.verdict.refusals = {cutOff};
        return cut;
    }
    if (!entry || glm::length(*entry - aim) > scene.tool.length) {
        return std::nullopt;
    }
    const double upright = glm::dot(skinNormal(s, reader, *entry), direction);
    if (upright < steepest) {
        return std::nullopt;
    }
    const double length = glm::length(*entry - aim);
    const double fired = firingDepth(scene.tool, length) + throwOf(scene.tool);
    const Vec3 end = *entry - (fired + beyondTip) * direction;
    const double room = s.obstacles.distance(*entry, end, comfort + scene.tool.radius) - scene.tool.radius;
    const double offCentre = std::max(0.0, fired - (length + halfNotch(scene.tool)));
    const WayVerdict verdict = s.judge.judge(reader, *entry, aim, *entry - fired * direction);
    const Proposal way{{*entry, aim}, length, room, std::acos(std::min(1.0, upright)), verdict, offCentre};
    return Line{way, length + verdict.detour + 3.0 * (std::max(0.0, comfort - room) + offCentre)};
}

// Ways into `aim` from all around, on Fibonacci's spiral.
void collectLines(const Scene& scene, const Surroundings& s, Vec3 aim, std::vector<Line>& lines,
                  std::map<std::string, int>& refused)
{
    std::vector<std::optional<Line>> found(directionCount);
    tbb::parallel_for(tbb::blocked_range<int>(0, directionCount, 20), [&](const tbb::blocked_range<int>& range) {
        const Tissue::Reader reader(s.tissue);
        for (int n = range.begin(); n < range.end(); ++n) {
            const double z = 1.0 - (2.0 * n + 1.0) / directionCount;
            const double angle = n * std::numbers::pi * (3.0 - std::sqrt(5.0));
            const double side = std::sqrt(1.0 - z * z);
            const Vec3 direction(side * std::cos(angle), side * std::sin(angle), z);
            found[static_cast<std::size_t>(n)] = lineAlong(scene, s, reader, aim, direction);
        }
    });
    for (const std::optional<Line>& line : found) {
        if (line && line->way.verdict.refusals.empty()) {
            lines.push_back(*line);
        }
        for (const std::string& why : line ? line->way.verdict.refusals : std::vector<std::string>{}) {
            ++refused[why];
        }
    }
}

// Why no way to the target is good enough, and what to do.
[[noreturn]] void refuseAll(const Scene& scene, const std::vector<Line>& lines, const std::map<std::string, int>& refused,
                            double least)
{
    std::string reasons = fmt::format("{} ways reach it", lines.size());
    for (const auto& [why, ways] : refused) {
        reasons += fmt::format("; {} go {}", ways, why);
    }
    if (!lines.empty()) {
        const auto wider = [](const Line& a, const Line& b) { return a.way.clearance < b.way.clearance; };
        const double widest = std::max_element(lines.begin(), lines.end(), wider)->way.clearance;
        reasons += fmt::format("; the widest keeps {:.1f} mm", 1e3 * std::max(0.0, widest));
    }
    const bool isCut = refused.contains(cutOff);
    throw base::error(
        "{}: no straight way to '{}' from the skin{} ({}): {}set entry_mm and aim_mm in [target]", scene.name, scene.target,
        lines.empty() && isCut ? "" : fmt::format(" that keeps {:g} mm from vital structures and bone", 1e3 * least),
        reasons, isCut ? "add 4 voxels of air around the body (palpate import --pad MM), or " : "");
}

// All lines to the target that keep `margin` from what is forbidden, or nothing to say how far, the most of `clearances`
// that some keep; the best first.
std::vector<Line> goodLines(const Scene& scene, const Tissue& tissue, std::optional<double> margin)
{
    const Surroundings s = surroundings(scene, tissue);
    std::vector<Line> lines;
    std::map<std::string, int> refused;
    for (const Vec3 aim : aims(scene, tissue)) {
        collectLines(scene, s, aim, lines, refused);
    }
    std::stable_sort(lines.begin(), lines.end(), [](const Line& a, const Line& b) { return a.cost < b.cost; });
    const std::vector<double> wanted =
        margin ? std::vector<double>{*margin} : std::vector<double>(std::begin(clearances), std::end(clearances));
    for (const double least : wanted) {
        std::vector<Line> good;
        std::copy_if(lines.begin(), lines.end(), std::back_inserter(good),
                     [&](const Line& line) { return line.way.clearance >= least; });
        if (!good.empty()) {
            return good;
        }
    }
    refuseAll(scene, lines, refused, wanted.back());
}

// Two lines between which there is something to choose.
bool differ(const Proposal& a, const Proposal& b)
{
    const Vec3 da = (a.approach.aim - a.approach.entry) / a.length, db = (b.approach.aim - b.approach.entry) / b.length;
    return glm::dot(da, db) < otherDirection || glm::length(a.approach.aim - b.approach.aim) > otherPlace;
}

constexpr double touchDepth = 1.5e-3;  // that a touch pushes the skin in: a needle pierces it at some millimetres [m]
constexpr double restTime = 3.5;       // three seconds, counted slowly [s]

// From before the skin to what is asked for.
std::vector<TraineeStep> stepsInside(const Scene& scene, const Approach& approach, double length, Vec3 inward)
{
    using Kind = TraineeStep::Kind;
    const bool needle = scene.tool.kind == ToolKind::needle;
    if (scene.task == SessionTask::touch) {
        const double front = needle ? 0.0 : scene.tool.radius;
        return {{.kind = Kind::press,
                 .to = approach.entry + (touchDepth - front) * inward,
                 .speed = 0.006,
                 .seconds = 4,
                 .tolerance = 1e-4},
                {.kind = Kind::wait, .seconds = restTime}};
    }
    const bool advances = scene.task == SessionTask::advance;
    const double depth = advances ? length : firingDepth(scene.tool, length);
    std::vector<TraineeStep> steps;
    if (needle) {
        steps.push_back({.kind = Kind::pierce, .to = approach.aim, .speed = 0.012, .seconds = 15});
    }
    steps.push_back({.kind = Kind::press,
                     .to = approach.entry + depth * inward,
                     .speed = 0.012,
                     .seconds = 15,
                     .tolerance = 1e-3,
                     .depth = needle ? depth : 0.0});
    if (needle && !advances) {
        steps.push_back({.kind = Kind::fire});
    }
    steps.push_back({.kind = Kind::wait, .seconds = 0.5});
    return steps;
}

}  // namespace

Approach planApproach(const Scene& scene, const Tissue& tissue)
{
    checkScene(scene);
    if (scene.entry) {
        return {*scene.entry, aims(scene, tissue).front()};
    }
    return goodLines(scene, tissue, std::nullopt).front().way.approach;
}

std::vector<Proposal> proposeApproaches(const Scene& scene, const Tissue& tissue, std::size_t most,
                                        std::optional<double> margin)
{
    std::vector<Proposal> out;
    for (const Line& line : goodLines(scene, tissue, margin)) {
        const bool isNew = std::all_of(out.begin(), out.end(), [&](const Proposal& p) { return differ(p, line.way); });
        if (isNew && out.size() < most) {
            out.push_back(line.way);
        }
    }
    return out;
}

// The tip then stands half a notch beyond the aim. A shallow aim is missed rather than fired at from outside.
double firingDepth(const ToolSpec& tool, double length) noexcept
{
    const double depth = length + halfNotch(tool) - throwOf(tool);
    return tool.kind == ToolKind::needle ? std::max(minInside, depth) : depth;
}

std::vector<TraineeStep> traineeScript(const Scene& scene, const Approach& approach)
{
    if (!scene.script.empty()) {
        return scene.script;
    }
    using Kind = TraineeStep::Kind;
    const double length = glm::length(approach.aim - approach.entry);
    const Vec3 inward = length > 0 ? (approach.aim - approach.entry) / length : Vec3(0, 1, 0);
    const Vec3 away = approach.entry - startDistance * inward;
    std::vector<TraineeStep> script{
        {.kind = Kind::move, .to = away, .speed = 0.04, .seconds = 4, .tolerance = 1e-3},
        {.kind = Kind::move, .to = approach.entry - 3e-3 * inward, .speed = 0.04, .seconds = 4, .tolerance = 1e-3}};
    std::ranges::move(stepsInside(scene, approach, length, inward), std::back_inserter(script));
    script.push_back({.kind = Kind::move, .to = away, .speed = 0.04, .seconds = 10, .tolerance = 2e-3});
    return script;
}

}  // namespace palpate::datasets
