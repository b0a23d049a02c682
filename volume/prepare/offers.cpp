#include <volume/prepare/offers.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>

namespace palpate::prepare {

namespace {

using datasets::LabelMap;
using volume::LabelName;

constexpr std::size_t maxLabels = 4;  // shown of each offer
constexpr std::size_t maxOffers = 6;

bool covers(const LabelMap& map, const LabelCounts& counts)
{
    return std::all_of(counts.begin(), counts.end(),
                       [&](const auto& label) { return label.first == 0 || find(map.labels, label.first) != nullptr; });
}

// The file's own names agree with the map's for every label that is there.
bool namesAgree(const LabelMap& map, const std::vector<LabelName>& names, const LabelCounts& counts)
{
    return std::all_of(counts.begin(), counts.end(), [&](const auto& label) {
        const LabelName* ours = find(map.labels, label.first);
        const LabelName* theirs = find(names, label.first);
        return label.first == 0 || (ours != nullptr && theirs != nullptr && sameName(ours->name, theirs->name));
    });
}

bool sameTissues(const LabelMap& a, const LabelMap& b, const LabelCounts& counts)
{
    return std::all_of(counts.begin(), counts.end(), [&](const auto& label) {
        const LabelName* first = find(a.labels, label.first);
        const LabelName* second = find(b.labels, label.first);
        return label.first == 0 || (first != nullptr && second != nullptr && first->tissue == second->tissue);
    });
}

}  // namespace

const LabelName* find(const std::vector<LabelName>& names, std::uint16_t value)
{
    const auto found = std::find_if(names.begin(), names.end(), [&](const LabelName& n) { return n.value == value; });
    return found == names.end() ? nullptr : &*found;
}

const LabelMap* recognised(const volume::ImportedLabels& labels, const LabelCounts& counts)
{
    const LabelMap* found = nullptr;
    if (labels.names.empty() || !labels.renumbered.empty()) {
        return found;
    }
    for (const LabelMap& map : datasets::labelMaps()) {
        if (!namesAgree(map, labels.names, counts)) {
            continue;
        }
        if (found != nullptr && !sameTissues(*found, map, counts)) {
            return nullptr;
        }
        found = found == nullptr ? &map : found;
    }
    return found;
}

std::string offers(const volume::ImportedLabels& labels, const LabelCounts& counts)
{
    std::vector<std::pair<std::uint64_t, std::uint16_t>> largest;
    for (const auto& [value, voxels] : counts) {
        if (const LabelName* own = find(labels.names, value); value != 0 && own != nullptr && tellsMore(*own)) {
            return "";
        }
        if (value != 0) {
            largest.emplace_back(voxels, value);
        }
    }
    if (!labels.renumbered.empty()) {
        return "";
    }
    std::ranges::sort(largest, std::greater<>());
    largest.resize(std::min(largest.size(), maxLabels));
    std::vector<const LabelMap*> fitting;
    for (const LabelMap& map : datasets::labelMaps()) {
        if (covers(map, counts)) {
            fitting.push_back(&map);
        }
    }
    std::ranges::stable_sort(fitting, {}, [](const LabelMap* map) { return map->labels.size(); });
    std::vector<std::string> list;
    for (std::size_t i = 0; i < std::min(fitting.size(), maxOffers); ++i) {
        std::vector<std::string> parts;
        for (const auto& [voxels, value] : largest) {
            parts.push_back(fmt::format("{} is {}", value, find(fitting[i]->labels, value)->name));
        }
        list.push_back(fmt::format("--map {} ({})", fitting[i]->name, fmt::join(parts, ", ")));
    }
    const std::string more =
        fitting.size() > maxOffers ? fmt::format(", or one of {} more", fitting.size() - maxOffers) : "";
    return list.empty() ? ""
                        : fmt::format("; its values would fit {}{}: is it one of these?", fmt::join(list, ", or "), more);
}

}  // namespace palpate::prepare
