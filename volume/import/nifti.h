#pragma once

#include <volume/import/source.h>

#include <algorithm>
#include <bit>

namespace palpate::volume {

/// The fields of a NIfTI-1 or NIfTI-2 header, in either byte order.
/// Offsets: https://nifti.nimh.nih.gov/nifti-1, https://nifti.nimh.nih.gov/nifti-2
class NiftiHeader {
public:
    NiftiHeader(std::vector<std::byte> bytes, bool second, bool swapped, bool analyze = false)
        : bytes_(std::move(bytes)), second_(second), swapped_(swapped), analyze_(analyze)
    {
    }

    static constexpr std::size_t firstBytes = 348;
    static constexpr std::size_t secondBytes = 540;

    bool swapped() const { return swapped_; }
    /// Analyze 7.5: sizes, type and spacings lie where NIfTI-1 has them, the rest means something else.
    bool analyze() const { return analyze_; }
    std::size_t length() const { return second_ ? secondBytes : firstBytes; }
    std::string magic() const { return text(second_ ? 4 : 344, 3); }
    std::int64_t dim(std::size_t i) const
    {
        return second_ ? get<std::int64_t>(16 + 8 * i) : get<std::int16_t>(40 + 2 * i);
    }
    double pixdim(std::size_t i) const { return second_ ? get<double>(104 + 8 * i) : single(76 + 4 * i); }
    int datatype() const { return get<std::int16_t>(second_ ? 12 : 70); }
    int bitpix() const { return get<std::int16_t>(second_ ? 14 : 72); }
    double voxOffset() const { return second_ ? static_cast<double>(get<std::int64_t>(168)) : single(108); }
    double slope() const { return second_ ? get<double>(176) : single(112); }
    double intercept() const { return second_ ? get<double>(184) : single(116); }
    int units() const { return second_ ? get<std::int32_t>(500) : get<std::uint8_t>(123); }
    int intent() const { return second_ ? get<std::int32_t>(504) : get<std::int16_t>(68); }
    int qformCode() const { return second_ ? get<std::int32_t>(344) : get<std::int16_t>(252); }
    int sformCode() const { return second_ ? get<std::int32_t>(348) : get<std::int16_t>(254); }
    /// b, c, d and the offsets x, y, z.
    double quaternion(std::size_t i) const { return second_ ? get<double>(352 + 8 * i) : single(256 + 4 * i); }
    double srow(std::size_t row, std::size_t column) const
    {
        return second_ ? get<double>(400 + 32 * row + 8 * column) : single(280 + 16 * row + 4 * column);
    }

private:
    template <typename T>
    T get(std::size_t offset) const
    {
        std::array<std::byte, sizeof(T)> raw{};
        std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(offset), sizeof(T), raw.begin());
        if (swapped_) {
            std::reverse(raw.begin(), raw.end());
        }
        return std::bit_cast<T>(raw);
    }
    double single(std::size_t offset) const { return static_cast<double>(get<float>(offset)); }
    std::string text(std::size_t offset, std::size_t length) const
    {
        return {reinterpret_cast<const char*>(bytes_.data()) + offset, length};
    }

    std::vector<std::byte> bytes_;
    bool second_;
    bool swapped_;
    bool analyze_;
};

/// The rule: the sform where it has a code, else the qform, else the plain axes; a warning where the first two disagree.
void placeNifti(const NiftiHeader& header, Source& source);

}  // namespace palpate::volume
