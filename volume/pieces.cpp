#include <base/error.h>
#include <volume/pieces.h>
#include <volume/runs.h>

#include <algorithm>
#include <limits>

namespace palpate::volume {

Pieces::Pieces(const LabelImage& image, const std::vector<std::uint16_t>& groupOf) : size_(image.size)
{
    std::size_t next = 0;  // the row whose first run is not known
    forEachRunOf(image, [&](std::uint16_t value, int first, int last, int y, int z) {
        const auto here = static_cast<std::size_t>(z) * static_cast<std::size_t>(size_.y) + static_cast<std::size_t>(y);
        for (; next <= here; ++next) {
            rows_.push_back(static_cast<std::uint32_t>(runs_.size()));
        }
        const std::uint16_t group = groupOf[value];
        if (group != 0 && first > 0 && runs_.size() > rows_.back() && runs_.back().last == first - 1 &&
            runs_.back().group == group) {
            runs_.back().last = last;
        } else if (group != 0) {
            runs_.push_back({first, last, static_cast<std::uint32_t>(runs_.size()), group});
        }
    });
    base::failIf(runs_.size() > std::numeric_limits<std::uint32_t>::max() / 2,
                 "a label map with over two thousand million runs is noise, not anatomy");
    rows_.push_back(static_cast<std::uint32_t>(runs_.size()));
    for (int z = 0; z < size_.z; ++z) {
        for (int y = 0; y < size_.y; ++y) {
            if (y > 0) {
                joinRows(row(y, z), row(y - 1, z));
            }
            if (z > 0) {
                joinRows(row(y, z), row(y, z - 1));
            }
        }
    }
    for (std::uint32_t i = 0; i < runs_.size(); ++i) {
        runs_[i].parent = find(i);
    }
}

std::vector<std::uint64_t> Pieces::voxels() const
{
    std::vector<std::uint64_t> count(runs_.size(), 0);
    for (const RowRun& run : runs_) {
        count[run.parent] += static_cast<std::uint64_t>(run.last - run.first + 1);
    }
    return count;
}

std::uint32_t Pieces::find(std::uint32_t run) noexcept
{
    while (runs_[run].parent != run) {
        runs_[run].parent = runs_[runs_[run].parent].parent;
        run = runs_[run].parent;
    }
    return run;
}

// The earlier run is the root, so that pieces have the same roots however they were joined.
void Pieces::join(std::uint32_t a, std::uint32_t b) noexcept
{
    a = find(a);
    b = find(b);
    runs_[std::max(a, b)].parent = std::min(a, b);
}

void Pieces::joinRows(std::pair<std::uint32_t, std::uint32_t> a, std::pair<std::uint32_t, std::uint32_t> b) noexcept
{
    while (a.first < a.second && b.first < b.second) {
        const RowRun& one = runs_[a.first];
        const RowRun& other = runs_[b.first];
        if (one.group == other.group && one.first <= other.last && other.first <= one.last) {
            join(a.first, b.first);
        }
        (one.last < other.last ? a.first : b.first) += 1;
    }
}

}  // namespace palpate::volume
