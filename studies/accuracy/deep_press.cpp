#include <studies/accuracy/deep_press.h>

#include <base/error.h>
#include <base/folds.h>
#include <base/processor_time.h>
#include <base/split.h>
#include <chainmail/elastic.h>
#include <haptics/simulation.h>
#include <studies/kernel/kernel_rivals.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <numbers>
#include <optional>
#include <string_view>

namespace palpate::studies {

namespace {

constexpr std::array<std::string_view, 11> columns{"scene", "tool", "radius_mm", "length_mm", "depth_mm", "way",
                                                   "fx_n",  "fy_n", "fz_n",      "edges_mm",  "elements"};
constexpr double longest = 200.0;  // of a tool and its way [mm]
constexpr double strongest = 1e3;  // [N]
constexpr double maxElements = 1e8;

// A line of the table.
class Row {
public:
    Row(std::string_view line, std::string where) : cells_(base::csvCells(line)), where_(std::move(where))
    {
        base::failIf(cells_.size() != columns.size(), "{}: {} values: must be {}: {}", where_, cells_.size(),
                     columns.size(), fmt::join(columns, ","));
    }

    bool isHead() const { return std::ranges::equal(cells_, columns); }

    std::string text(std::size_t column) const { return std::string(cells_[column]); }

    // One of these words: its place among them.
    std::size_t word(std::size_t column, std::initializer_list<std::string_view> words) const
    {
        const auto* const found = std::ranges::find(words, cells_[column]);
        base::failIf(found == words.end(), "{}: {} = '{}': must be {}", where_, columns[column], cells_[column],
                     fmt::join(words, " or "));
        return static_cast<std::size_t>(found - words.begin());
    }

    double number(std::size_t column, double least, double most) const
    {
        const std::string_view cell = cells_[column];
        const std::optional<double> value = base::numberIn(cell);
        base::failIf(!value || !(*value >= least && *value <= most), "{}: {} = '{}': must be a number from {:g} to {:g}",
                     where_, columns[column], cell, least, most);
        return *value;
    }

private:
    std::vector<std::string_view> cells_;
    std::string where_;
};

DeepCase caseOf(const Row& row)
{
    constexpr double least = 0.1;  // radius [mm]
    DeepCase out;
    out.scene = row.text(0);
    const bool capsule = row.word(1, {"sphere", "capsule"}) == 1;
    const double radius = row.number(2, least, longest), length = row.number(3, 0.0, capsule ? longest : 0.0);
    out.tool = {capsule ? fmt::format("capsule {:g} x {:g} mm", radius, length) : fmt::format("sphere {:g} mm", radius),
                capsule ? TrialKind::capsule : TrialKind::sphere, 1e-3 * radius, 1e-3 * length};
    return out;
}

DeepReference referenceOf(const Row& row)
{
    constexpr double least = 0.01;  // [mm]
    DeepReference out;
    out.depth = 1e-3 * row.number(4, least, longest);
    out.way = row.word(5, {"in", "out"}) == 0 ? PressWay::in : PressWay::out;
    out.force = {row.number(6, -strongest, strongest), row.number(7, -strongest, strongest),
                 row.number(8, -strongest, strongest)};
    out.edges = 1e-3 * row.number(9, least, longest);
    out.elements = static_cast<std::size_t>(row.number(10, 1.0, maxElements));
    return out;
}

constexpr int holdTicks = 200;

constexpr std::array<GridPlace, 6> sixPlaces{
    {{0.0, 0.0, 1}, {0.25, 0.0, 4}, {0.5, 0.0, 2}, {0.25, 0.25, 4}, {0.5, 0.25, 4}, {0.5, 0.5, 1}}};

// The force of every tick, by depth.
struct Felt {
    PressWay way;
    double depth;  // below the first touch; negative above it [m]
    Vec3 force;    // [N]
};

// In, hold, out.
std::vector<std::pair<PressWay, double>> wayOf(const TrialPath& path, double speed)
{
    const int in = std::max(1, static_cast<int>(std::lround(path.press / (speed * haptics::tickSeconds))));
    std::vector<std::pair<PressWay, double>> pressed;
    for (int t = 1; t <= in; ++t) {
        pressed.emplace_back(PressWay::in, path.press * t / in);
    }
    pressed.insert(pressed.end(), holdTicks, {PressWay::hold, path.press});
    for (int t = in; t >= 0; --t) {
        pressed.emplace_back(PressWay::out, path.press * t / in);
    }
    return pressed;
}

std::vector<Felt> feel(Elastic& elastic, const TrialPath& path, double speed, DeepPress& out, std::vector<double>& seconds)
{
    std::vector<Felt> felt;
    TrialLoad load(path);
    for (const auto& [way, pressed] : wayOf(path, speed)) {
        load.set({pressed, 0.0});
        const double start = base::processorTime();
        elastic.relax(load.load());
        const double took = base::processorTime() - start;
        const Vec3 force = elastic.toolForce(0);
        base::failIf(!std::isfinite(glm::length(force)), "the force {:.2f} mm below the surface is no number",
                     1e3 * (pressed - path.gap));
        if (!elastic.atRest()) {
            seconds.push_back(took);
        }
        out.pull = std::max(out.pull, glm::dot(force, path.inward));
        felt.push_back({way, pressed - path.gap, force});
    }
    return felt;
}

// Where this part of the way passes a depth.
Vec3 forceAt(std::span<const Felt> felt, PressWay way, double depth)
{
    constexpr double rounding = 1e-9;  // [m]
    const Felt* before = nullptr;
    for (const Felt& f : felt) {
        if (f.way != way) {
            continue;
        }
        if (std::abs(f.depth - depth) < rounding) {
            return f.force;
        }
        if (before != nullptr && (before->depth - depth) * (f.depth - depth) < 0.0) {
            const double fraction = (depth - before->depth) / (f.depth - before->depth);
            return (1.0 - fraction) * before->force + fraction * f.force;
        }
        before = &f;
    }
    return before != nullptr ? before->force : Vec3(0.0);
}

void addLooks(std::span<const Felt> felt, const DeepCase& what, std::size_t place, DeepPress& out)
{
    const auto add = [&](PressWay way, const DeepReference& r) {
        const Vec3 force = way == PressWay::hold ? std::ranges::find(felt.rbegin(), felt.rend(), way, &Felt::way)->force
                                                 : forceAt(felt, way, r.depth);
        out.looks.push_back({place, way, r.depth, force, r.force, r.edges});
    };
    for (const DeepReference& r : what.references) {
        add(r.way, r);
        if (r.way == PressWay::out) {
            continue;
        }
        const bool own = std::ranges::any_of(what.references, [&](const DeepReference& other) {
            return other.way == PressWay::out && other.depth == r.depth;
        });
        if (r.depth == what.deepest()) {
            add(PressWay::hold, r);
        } else if (!own) {
            add(PressWay::out, r);
        }
    }
}

}  // namespace

const char* wayName(PressWay way) noexcept
{
    return way == PressWay::in ? "in" : way == PressWay::hold ? "hold" : "out";
}

double DeepCase::deepest() const noexcept
{
    return base::largestOf(references, &DeepReference::depth);
}

std::vector<DeepCase> readDeepCases(std::istream& in, const std::string& origin)
{
    std::vector<DeepCase> cases;
    bool head = true;
    std::size_t number = 0;
    for (std::string line; std::getline(in, line);) {
        ++number;
        if (const auto text = base::trimmed(line); text.empty() || text.front() == '#') {
            continue;
        }
        const Row row(line, fmt::format("{}:{}", origin, number));
        if (head) {
            base::failIf(!row.isHead(), "{}:{}: no line of column names: begin with {}", origin, number,
                         fmt::join(columns, ","));
            head = false;
            continue;
        }
        const DeepCase own = caseOf(row);
        const auto same = [&](const DeepCase& c) { return c.scene == own.scene && c.tool.name == own.tool.name; };
        auto found = std::ranges::find_if(cases, same);
        if (found == cases.end()) {
            found = cases.insert(cases.end(), own);
        }
        found->references.push_back(referenceOf(row));
    }
    base::failIf(cases.empty(), "{}: holds no forces", origin);
    return cases;
}

std::vector<DeepCase> loadDeepCases(const std::filesystem::path& file)
{
    std::ifstream in(file);
    base::failIf(!in, "{}: cannot be read: is it there, and may it be read?", file.native());
    return readDeepCases(in, file.string());
}

using namespace chainmail;

std::span<const GridPlace> gridPlaces() noexcept
{
    return sixPlaces;
}

double DeepLook::errorPercent() const noexcept
{
    return 100.0 * (glm::length(force) / glm::length(reference) - 1.0);
}

double DeepLook::directionDegrees() const noexcept
{
    const double across = glm::length(glm::cross(force, reference)), along = glm::dot(force, reference);
    return std::atan2(across, along) * 180.0 / std::numbers::pi;
}

DeepZone zoneOf(double depth, double radius, double spacing) noexcept
{
    constexpr double half = 0.5, most = 1.5, rounding = 1e-9;
    const double cells = std::sqrt(radius * depth) / spacing, radii = depth / radius;
    if (cells < half) {
        return DeepZone::faint;
    }
    return radii > most + rounding  ? DeepZone::deepest
           : radii > 1.0 + rounding ? DeepZone::deep
           : cells <= most          ? DeepZone::touch
                                    : DeepZone::middle;
}

DeepPress pressDeep(const haptics::SessionModel& model, const DeepCase& what, const datasets::ElasticSettings& settings,
                    const DeepOptions& options)
{
    DeepPress out;
    std::vector<double> seconds;
    const TrialPlace entry = trialPlace(*model.tissue, model.surface, model.approach.entry, model.approach.aim);
    for (std::size_t i = 0; i < options.places.size(); ++i) {
        const GridPlace& at = options.places[i];
        const TrialBody body = trialBody(*model.tissue, model.surface, settings.spacing, settings.poissonCap, maxTrialNodes,
                                         Vec3(at.across, 0.0, at.along));
        out.spacing = body.cells.spacing;
        TrialPath path = trialPath(*model.tissue, model.surface, entry, what.tool, out.spacing);
        path.press = path.gap + what.deepest();
        path.drag = 0.0;
        Elastic elastic(body.body, haptics::elasticOptions(settings), TrialLoad(path).load().focus);
        addLooks(feel(elastic, path, options.speed, out, seconds), what, i, out);
    }
    out.ticks = seconds.size();
    out.times = tickTimes(std::move(seconds));
    return out;
}

}  // namespace palpate::studies
