#include <render/concealment.h>

#include <base/error.h>
#include <render/events.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <limits>
#include <utility>

namespace palpate::render {
namespace {

using Rows = std::array<bool, channel::maxTissues>;

Rows rowsOf(const std::string& tissue, const channel::Scenery& scenery)
{
    constexpr std::size_t longest = channel::nameLength - 1, mark = 3;  // a scenery cuts names off, between characters
    const auto blanks = [](std::string name) {
        std::ranges::replace(name, '_', ' ');
        return name;
    };
    const std::string asked = blanks(tissue);
    Rows rows{};
    for (std::size_t row = 1; row < std::min<std::size_t>(scenery.tissues, channel::maxTissues); ++row) {
        const std::string name = blanks(text(scenery.tissue[row].name));
        rows[row] = asked == name || (asked.size() > longest && name.size() + mark >= longest && asked.starts_with(name));
    }
    return rows;
}

Rows concealedRows(const Concealment& what, const channel::Scenery& scenery)
{
    Rows rows{};
    for (const std::string& tissue : what.tissues)
        std::ranges::transform(rows, rowsOf(tissue, scenery), rows.begin(), std::logical_or());
    return rows;
}

}  // namespace

void checkTissues(const Concealment& what, const channel::Scenery& scenery, std::span<const std::uint8_t> labels)
{
    const auto isThere = [&](const std::string& tissue) {
        return std::ranges::any_of(rowsOf(tissue, scenery), std::identity());
    };
    const auto unknown = std::ranges::find_if_not(what.tissues, isThere);
    if (unknown == what.tissues.end())
        return;
    Rows inBody{};
    for (const std::uint8_t label : labels)
        inBody[label & channel::rowBits] = true;
    std::string names;
    for (std::size_t row = 1; row < std::min<std::size_t>(scenery.tissues, channel::maxTissues); ++row)
        names += inBody[row] ? (names.empty() ? "" : ", ") + text(scenery.tissue[row].name) : "";
    throw base::error("--hide {}: there is no such tissue; the body has: {}", *unknown, names);
}

void conceal(const Concealment& what, channel::Scenery& scenery)
{
    // What is to be found lies anywhere: the line of the scene leads past it.
    if (what.any() || scenery.task == channel::Task::find)
        scenery.entry = scenery.aim;
}

void conceal(const Concealment& what, channel::State& state)
{
    if (!what.any())
        return;
    state.distance[0] = state.ahead[0] = std::numeric_limits<double>::infinity();
    state.aheadTissue = 0;
    state.reached = 0;
    if (!what.tissues.empty())
        state.tissue = 0;
}

void conceal(const Concealment& what, History::Moment& moment)
{
    if (what.any())
        moment.distance[0] = std::numeric_limits<float>::infinity();
}

// Layer by layer: each voxel takes the label of a neighbour that is shown.
void conceal(const Concealment& what, const channel::Scenery& scenery, const channel::Grid& grid,
             std::span<std::uint8_t> labels)
{
    if (what.tissues.empty() || labels.empty())
        return;
    const auto hidden = concealedRows(what, scenery);
    const auto isHidden = [&](std::size_t at) { return hidden[labels[at] & channel::rowBits]; };
    std::vector<std::size_t> left;
    for (std::size_t at = 0; at < labels.size(); ++at)
        if (isHidden(at))
            left.push_back(at);
    const std::array<std::ptrdiff_t, 3> size{grid.size[0], grid.size[1], grid.size[2]};
    const std::array<std::ptrdiff_t, 3> stride{1, size[0], size[0] * size[1]};
    const auto shownNeighbour = [&](std::size_t at) -> std::uint8_t {
        for (std::size_t axis = 0; axis < 3; ++axis)
            for (const std::ptrdiff_t step : {-1, 1}) {
                const std::ptrdiff_t place = static_cast<std::ptrdiff_t>(at) / stride[axis] % size[axis] + step;
                const auto to = static_cast<std::size_t>(static_cast<std::ptrdiff_t>(at) + step * stride[axis]);
                if (place >= 0 && place < size[axis] && (labels[to] & channel::rowBits) != 0 && !isHidden(to))
                    return labels[to] & channel::rowBits;
            }
        return 0;
    };
    while (!left.empty()) {
        std::vector<std::pair<std::size_t, std::uint8_t>> found;
        std::vector<std::size_t> deeper;
        for (const std::size_t at : left)
            if (const std::uint8_t label = shownNeighbour(at); label != 0)
                found.emplace_back(at, label);
            else
                deeper.push_back(at);
        if (found.empty())
            return;
        for (const auto& [at, label] : found)
            labels[at] = label;
        left = std::move(deeper);
    }
}

}  // namespace palpate::render
