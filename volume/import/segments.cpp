#include <base/mapped.h>
#include <volume/import/label_sink.h>
#include <volume/import/segments.h>

#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <numeric>
#include <set>

namespace palpate::volume {

namespace {

constexpr std::size_t maxSaid = 5;            // segments in a warning about each
constexpr std::size_t maxSegmentsNamed = 12;  // in a list of names

std::vector<std::string> namesOf(const std::vector<Segment>& segments)
{
    return base::mapped<std::string>(segments, [&](const Segment& s) { return s.label.name; });
}

// Indices of segments, the winner of all first.
std::vector<std::size_t> winnersFirst(const std::filesystem::path& file, const std::vector<Segment>& segments,
                                      const std::vector<std::string>& overlap)
{
    std::vector<std::size_t> order(segments.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    const std::string rule = overlap.empty() ? "smallest" : overlap.size() == 1 ? overlap[0] : "";
    if (rule == "first") {
        return order;
    }
    std::reverse(order.begin(), order.end());
    if (rule == "last") {
        return order;
    }
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return segments[a].voxels < segments[b].voxels; });
    if (rule == "smallest") {
        return order;
    }
    // Each name that is given moves before all that were moved so far.
    for (const std::string& name : overlap) {
        const auto found =
            std::find_if(order.begin(), order.end(), [&](std::size_t i) { return segments[i].label.name == name; });
        refuseIf(found == order.end(), file, "--overlap names '{}', which is no segment of it: it has {}", name,
                 fmt::join(namesOf(segments), ", "));
        std::rotate(order.begin(), found, found + 1);
    }
    return order;
}

// A value of its own for each segment.
void makeUnique(const std::filesystem::path& file, std::vector<Segment>& segments, std::vector<std::string>& warnings)
{
    std::set<std::uint16_t> taken = {0};
    int highest = 0;
    std::vector<std::string> changed;
    for (const Segment& s : segments) {
        highest = std::max(highest, static_cast<int>(s.label.value));
    }
    for (Segment& s : segments) {
        if (taken.insert(s.label.value).second) {
            continue;
        }
        refuseIf(++highest > 65535, file, "its segments need label values over 65535: save it with fewer");
        changed.push_back(fmt::format("segment '{}' has label value {}, which is taken: it gets {}", s.label.name,
                                      s.label.value, highest));
        s.label.value = static_cast<std::uint16_t>(highest);
        taken.insert(s.label.value);
    }
    if (changed.size() > maxSaid) {
        changed[maxSaid] = fmt::format("so do {} more", changed.size() - maxSaid);
        changed.resize(maxSaid + 1);
    }
    if (!changed.empty()) {
        warnings.push_back(fmt::format("{}", fmt::join(changed, "; ")));
    }
}

using Losses = std::map<std::pair<std::uint16_t, std::uint16_t>, std::uint64_t>;  // loser and winner, voxels

// A segment takes the voxels that no winner over it has.
void claim(const Segment& segment, std::vector<std::uint16_t>& labels, Losses& lost)
{
    for (const Run& run : segment.runs) {
        for (std::uint32_t v = run.begin; v < run.end; ++v) {
            if (labels[v] != 0) {
                ++lost[{segment.label.value, labels[v]}];
            } else {
                labels[v] = segment.label.value;
            }
        }
    }
}

}  // namespace

void flatten(const std::filesystem::path& file, std::vector<Segment> segments, const ImportOptions& options,
             ImportedLabels& out)
{
    std::vector<std::string> empty;
    std::erase_if(segments, [&](const Segment& s) {
        if (s.voxels == 0) {
            empty.push_back(s.label.name);
        }
        return s.voxels == 0;
    });
    refuseIf(segments.empty(), file, "no voxel is set in any of its segments: give a segmentation that holds something");
    if (!empty.empty()) {
        const std::size_t all = empty.size();
        empty.resize(std::min(all, maxSegmentsNamed));
        out.warnings.push_back(
            fmt::format("segments without a voxel are left out: {}{}", fmt::join(empty, ", "),
                        all > maxSegmentsNamed ? fmt::format(" and {} more", all - maxSegmentsNamed) : ""));
    }
    makeUnique(file, segments, out.warnings);
    LabelImage& image = out.image;
    image.values.assign(image.offset({0, 0, image.size.z}), 0);
    Losses lost;
    for (const std::size_t i : winnersFirst(file, segments, options.overlap)) {
        claim(segments[i], image.values, lost);
    }
    for (const auto& [pair, voxels] : lost) {
        out.overlaps.push_back({pair.second, pair.first, voxels});
    }
    std::stable_sort(out.overlaps.begin(), out.overlaps.end(),
                     [](const Overlap& a, const Overlap& b) { return a.voxels > b.voxels; });
    std::ranges::transform(segments, std::back_inserter(out.names), &Segment::label);
}

std::vector<Segment> layeredSegments(const Source& source, const ImportOptions& options)
{
    std::vector<Segment> segments;
    std::map<std::pair<std::uint64_t, std::uint16_t>, std::size_t> index;  // layer and value
    const auto append = [&](LabelName label, std::uint64_t layer, std::uint16_t value) {
        index.emplace(std::pair(layer, value), segments.size());
        segments.push_back({std::move(label), {}, 0});
    };
    for (const SegmentName& s : source.segments) {
        append(s.label, s.layer, s.label.value);
    }
    constexpr std::size_t most = 4096;  // segments
    std::uint64_t element = 0;
    decode(source, options.progress, [&](std::span<const double> values) {
        for (const double number : values) {
            const std::uint64_t at = element++;
            if (number == 0) {
                continue;
            }
            const std::uint64_t layer = at / source.inner % source.layers;
            const std::uint64_t voxel = at / source.inner / source.layers * source.inner + at % source.inner;
            const std::uint16_t value =
                LabelSink::label(source.header, number, {source.scaled, options}, fmt::format("voxel {}", voxel));
            if (index.count({layer, value}) == 0) {
                append({value, fmt::format("layer {} value {}", layer, value), ""}, layer, value);
            }
            refuseIf(segments.size() > most, source.header,
                     "has more than {} segments, so it is an image: give the segmentation that "
                     "was made of it",
                     most);
            segments[index.at({layer, value})].add(static_cast<std::uint32_t>(voxel));
        }
    });
    return segments;
}

}  // namespace palpate::volume
