#include <volume/import/source.h>

#include <algorithm>
#include <bit>
#include <map>
#include <utility>

namespace palpate::volume {

namespace {

constexpr std::size_t headerBytes = 284;  // the voxels begin here

template <typename T>
T bigEndian(const std::vector<std::byte>& bytes, std::size_t offset)
{
    std::array<std::byte, sizeof(T)> raw{};
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(offset), sizeof(T), raw.begin());
    if (std::endian::native == std::endian::little) {
        std::reverse(raw.begin(), raw.end());
    }
    return std::bit_cast<T>(raw);
}

}  // namespace

// FreeSurfer's .mgh and .mgz. Format: https://surfer.nmr.mgh.harvard.edu/fswiki/FsTutorial/MghFormat
Source readMgh(const std::filesystem::path& file)
{
    Source source;
    source.header = source.data = file;
    source.encoding = looksLike(file, 0);
    const std::vector<std::byte> bytes = unpackedBytes(file, source.encoding, 0, headerBytes);
    refuseIf(bytes.size() < headerBytes || bigEndian<std::int32_t>(bytes, 0) != 1, file,
             "is not a FreeSurfer volume, its header does not begin with version 1: save it again");
    const auto integer = [&](std::size_t at) { return bigEndian<std::int32_t>(bytes, at); };
    const auto number = [&](std::size_t at) { return static_cast<double>(bigEndian<float>(bytes, at)); };
    std::vector<std::int64_t> sizes = {integer(4), integer(8), integer(12)};
    if (integer(16) != 1) {
        sizes.push_back(integer(16));
    }
    source.size = checkedVolumes(file, sizes, source);
    static const std::map<int, Component> types = {
        {0, Component::u8}, {1, Component::i32}, {3, Component::f32}, {4, Component::i16}, {10, Component::u16}};
    const auto type = types.find(integer(20));
    refuseIf(type == types.end(), file, "its type of voxel, {}, is not read: save it with whole numbers", integer(20));
    source.component = type->second;
    source.bigEndian = true;
    source.skip = headerBytes;

    // RAS: direction cosines of the three axes, and the centre of the volume at index size / 2.
    Mat3 linear(0.0);
    Vec3 centre(0.0);
    const bool placed = bigEndian<std::int16_t>(bytes, 28) > 0;
    const Mat3 coronal(-1, 0, 0, 0, 0, -1, 0, 1, 0);
    for (int axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<std::size_t>(axis);
        for (int row = 0; row < 3; ++row) {
            const auto r = static_cast<std::size_t>(row);
            linear[axis][row] = placed ? number(30 + 4 * a) * number(42 + 12 * a + 4 * r) : coronal[axis][row];
        }
        centre[axis] = placed ? number(78 + 4 * a) : 0.0;
    }
    const Vec3 flip(-1e-3, -1e-3, 1e-3);
    source.affine = {Mat3(linear[0] * flip, linear[1] * flip, linear[2] * flip),
                     (centre - linear * (0.5 * Vec3(source.size))) * flip};
    if (!placed) {
        source.warnings.emplace_back(
            "its header gives no place: voxels of 1 mm are assumed, and FreeSurfer's coronal axes unless --axes says "
            "otherwise");
        source.oriented = false;
        source.assumed = std::exchange(source.affine, {Mat3(1e-3), -0.5e-3 * Vec3(source.size)});
    }
    source.trailer = std::uint64_t{1} << 20;  // scanner parameters and tags
    return source;
}

}  // namespace palpate::volume
