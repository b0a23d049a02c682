#include <studies/accuracy/deep_references.h>

#include <base/error.h>
#include <base/split.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <fstream>
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
        if (found == words.end()) {
            throw base::error("{}: {} = '{}': must be {}", where_, columns[column], cells_[column],
                              fmt::join(words, " or "));
        }
        return static_cast<std::size_t>(found - words.begin());
    }

    double number(std::size_t column, double least, double most) const
    {
        const std::string_view cell = cells_[column];
        const std::optional<double> value = base::numberIn(cell);
        if (!value || !(*value >= least && *value <= most)) {
            throw base::error("{}: {} = '{}': must be a number from {:g} to {:g}", where_, columns[column], cell, least,
                              most);
        }
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

}  // namespace

const char* wayName(PressWay way) noexcept
{
    return way == PressWay::in ? "in" : way == PressWay::hold ? "hold" : "out";
}

double DeepCase::deepest() const noexcept
{
    double depth = 0.0;
    for (const DeepReference& r : references) {
        depth = std::max(depth, r.depth);
    }
    return depth;
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

}  // namespace palpate::studies
