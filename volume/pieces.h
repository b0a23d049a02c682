#pragma once

#include <volume/label_image.h>

#include <cstdint>
#include <span>
#include <vector>

// Inside volume/ only: connected pieces of a label map.
namespace palpate::volume {

/// A row's voxels from `first` to `last`, both included, of one class.
struct RowRun {
    int first = 0, last = 0;   // along x
    std::uint32_t parent = 0;  // another run of the same piece; its own index at the root
    std::uint16_t group = 0;   // the class that its voxels have
};

/// Pieces of voxels of one class that hang together by faces (6-connected), as runs along x.
/// Source: A. Rosenfeld, J. L. Pfaltz, "Sequential Operations in Digital Picture Processing", J. ACM 13, 1966, on runs.
class Pieces {
public:
    /// @param image  labels    @param groupOf  the class of each of their values; those of class 0 are in no piece (65536 x
    /// 1)
    Pieces(const LabelImage& image, const std::vector<std::uint16_t>& groupOf);

    std::span<const RowRun> runs() const noexcept { return runs_; }
    /// The runs of row (y, z), as a range of runs().
    std::pair<std::uint32_t, std::uint32_t> row(int y, int z) const noexcept
    {
        const auto at = static_cast<std::size_t>(z) * static_cast<std::size_t>(size_.y) + static_cast<std::size_t>(y);
        return {rows_[at], rows_[at + 1]};
    }
    /// The run that stands for the whole piece of `run`.
    std::uint32_t root(std::uint32_t run) const noexcept { return runs_[run].parent; }
    /// Voxels of every piece, at its root (runs x 1).
    std::vector<std::uint64_t> voxels() const;

private:
    std::uint32_t find(std::uint32_t run) noexcept;
    void join(std::uint32_t a, std::uint32_t b) noexcept;
    void joinRows(std::pair<std::uint32_t, std::uint32_t> a, std::pair<std::uint32_t, std::uint32_t> b) noexcept;

    Index3 size_;
    std::vector<RowRun> runs_;         // by z, then y, then x
    std::vector<std::uint32_t> rows_;  // first run of each row, and the end
};

}  // namespace palpate::volume
