#include <volume/image_check.h>
#include <volume/import/source.h>

#include <base/units.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

namespace palpate::volume {

namespace {

constexpr std::uint64_t maxVoxels = 0xffffffff;  // of one volume
constexpr std::uint64_t maxPadding = 16;         // [bytes]
constexpr std::uint64_t maxBefore = 1 << 30;     // unpacked, in front of voxels that are the last bytes [bytes]
using units::degree;

template <typename T>
void appendAs(std::span<const std::byte> bytes, bool turned, std::vector<double>& out)
{
    const std::size_t count = bytes.size() / sizeof(T);
    const std::size_t first = out.size();
    out.resize(first + count);
    for (std::size_t i = 0; i < count; ++i) {
        std::array<std::byte, sizeof(T)> raw;
        std::memcpy(raw.data(), bytes.data() + i * sizeof(T), sizeof(T));
        if (turned) {
            std::reverse(raw.begin(), raw.end());
        }
        out[first + i] = static_cast<double>(std::bit_cast<T>(raw));
    }
}

void append(Component component, std::span<const std::byte> bytes, bool turned, std::vector<double>& out)
{
    constexpr std::array all{appendAs<std::uint8_t>,  appendAs<std::int8_t>,   appendAs<std::uint16_t>,
                             appendAs<std::int16_t>,  appendAs<std::uint32_t>, appendAs<std::int32_t>,
                             appendAs<std::uint64_t>, appendAs<std::int64_t>,  appendAs<float>,
                             appendAs<double>};  // by Component
    all[static_cast<std::size_t>(component)](bytes, turned, out);
}

}  // namespace

Index3 checkedSize(const std::filesystem::path& file, const std::vector<std::int64_t>& sizes)
{
    const std::string text = fmt::format("{}", fmt::join(sizes, " x "));
    refuseIf(sizes.size() > 3, file, "has {} dimensions ({}): save one volume of it", sizes.size(), text);
    refuseIf(sizes.size() < 3, file, "has {} dimensions ({}): a volume has 3, give one", sizes.size(), text);
    if (std::any_of(sizes.begin(), sizes.end(), [](std::int64_t n) { return n < 1 || n > 32767; })) {
        refuse(file, "its size is {}: each side must be 1 to 32767 voxels, save it again", text);
    }
    refuseIf(static_cast<std::uint64_t>(sizes[0] * sizes[1] * sizes[2]) > maxVoxels, file,
             "its size is {}: more than {} voxels are not read, crop or resample it", text, maxVoxels);
    return {static_cast<int>(sizes[0]), static_cast<int>(sizes[1]), static_cast<int>(sizes[2])};
}

// Readers return zeros, or what lay in memory, for what is missing.
void checkBytes(Source& source)
{
    const std::uint64_t width = source.encoding == Encoding::text ? sizeof(double) : bytesOf(source.component);
    const std::uint64_t wanted = source.elements() * width;
    const std::uint64_t most =
        source.fromEnd ? wanted + maxBefore : source.skip + wanted + std::max(maxPadding, source.trailer);
    const std::uint64_t there = unpackedSize(source.data, source.offset, source.encoding, most);
    if (source.fromEnd && there >= wanted && (there <= most || source.encoding == Encoding::raw)) {
        source.skip = there - wanted;
        return;
    }
    const std::uint64_t expected = source.skip + wanted;
    const std::string size =
        fmt::format("{} x {} x {}{}", source.size.x, source.size.y, source.size.z,
                    source.layers * source.volumes > 1
                        ? fmt::format(" x {} {}", source.layers * source.volumes, source.layers > 1 ? "layers" : "volumes")
                        : "");
    const std::string sizes =
        source.encoding == Encoding::text
            ? fmt::format("its header promises {} voxels, but there are {} numbers", size, there / width)
            : fmt::format("its header promises {} voxels of {} bytes, {} in all, but there are {}{}", size, width, expected,
                          there > most ? "more than " : "", std::min(there, most));
    refuseIf(there < expected, source.header, "{}: it is cut short or its header is wrong, get or save it again", sizes);
    if (there - expected <= source.trailer) {
        return;
    }
    // A little padding at the end is harmless; what could be a wrong size, or a header of its own, is not.
    const Index3 n = source.size;
    const auto sheet = static_cast<std::uint64_t>(std::min({n.x * n.y, n.y * n.z, n.x * n.z}));
    refuseIf(there - expected >= std::min(maxPadding, sheet * width), source.header,
             "{}: its header is wrong or the data begin elsewhere, save it again", sizes);
    if (there > expected) {
        source.warnings.push_back(fmt::format("{} bytes behind the voxels are ignored", there - expected));
    }
}

void decode(const Source& source, const std::function<void(double)>& progress,
            const std::function<void(std::span<const double>)>& sink)
{
    const bool text = source.encoding == Encoding::text;
    const Component component = text ? Component::f64 : source.component;
    const std::uint64_t width = bytesOf(component);
    const bool turned = !text && source.bigEndian != (std::endian::native == std::endian::big);
    std::uint64_t skip = source.skip;
    std::uint64_t left = source.elements() * width;
    const double all = static_cast<double>(left);
    std::vector<std::byte> kept;  // the beginning of an element whose end is in the next piece
    std::vector<double> values;
    std::uint64_t element = 0;
    unpack(source.data, source.offset, source.encoding, [&](std::span<const std::byte> bytes) {
        const std::uint64_t over = std::min<std::uint64_t>(skip, bytes.size());
        skip -= over;
        const auto rest = bytes.subspan(over);
        const auto wanted = rest.first(std::min<std::uint64_t>(rest.size(), left));
        left -= wanted.size();
        values.clear();
        std::size_t used = 0;
        if (!kept.empty()) {
            used = std::min<std::size_t>(width - kept.size(), wanted.size());
            kept.insert(kept.end(), wanted.begin(), wanted.begin() + static_cast<std::ptrdiff_t>(used));
            if (kept.size() == width) {
                append(component, kept, turned, values);
                kept.clear();
            }
        }
        const std::size_t whole = (wanted.size() - used) / width * width;
        append(component, wanted.subspan(used, whole), turned, values);
        kept.insert(kept.end(), wanted.begin() + static_cast<std::ptrdiff_t>(used + whole), wanted.end());
        if (source.scaled) {
            for (double& v : values) {
                v = source.slope * v + source.intercept;
            }
        }
        if (source.volumes > 1) {
            std::erase_if(values, [&](double) { return element++ / source.volumeInner % source.volumes != source.volume; });
        }
        sink(values);
        if (progress) {
            progress(1.0 - static_cast<double>(left) / all);
        }
        return left > 0;
    });
    refuseIf(left > 0, source.header, "its data changed while they were read: try again");
}

void checkAffine(const std::filesystem::path& file, const Affine& affine, bool sheared, std::vector<std::string>& warnings)
{
    const Vec3 spacing = affine.spacing();
    const Vec3 origin = 1e3 * affine.origin + 0.0;  // no -0
    refuseIf(!std::isfinite(glm::dot(affine.origin, Vec3(1.0))), file,
             "its first voxel lies at {:g}, {:g}, {:g} mm: the origin in its header is wrong, save it again", origin.x,
             origin.y, origin.z);
    refuseIf(!std::isfinite(affine.voxelVolume()) || !(spacing.x > 0 && spacing.y > 0 && spacing.z > 0), file,
             "its voxels are {} x {} x {} mm: the spacing in its header is wrong, save it again", 1e3 * spacing.x,
             1e3 * spacing.y, 1e3 * spacing.z);
    refuseIf(std::max({spacing.x, spacing.y, spacing.z}) > maxSpacing ||
                 std::min({spacing.x, spacing.y, spacing.z}) < minSpacing,
             file, "its voxels are {} x {} x {} mm: that is no patient, check the units in its header", 1e3 * spacing.x,
             1e3 * spacing.y, 1e3 * spacing.z);
    const double shear = shearOf(affine);
    // Three axes can be at wrong angles in pairs too small to see, and still lie in one plane.
    refuseIf(affine.voxelVolume() < 1e-3 * spacing.x * spacing.y * spacing.z, file,
             "its voxel axes lie in one plane: the directions in its header are wrong, save it again");
    if (std::sin(shear) <= maxShear) {
        return;
    }
    const std::string said = fmt::format(
        "its voxel axes are sheared by {:.1f} degrees (a tilted gantry, or an affine "
        "registration)",
        shear / degree);
    refuseIf(!sheared, file, "{}: give --voxel MM, which resamples it to a straight grid", said);
    warnings.push_back(said);
}

double voxelsApart(const Affine& a, const Affine& b, Index3 size)
{
    double most = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3 index = Vec3(size - 1) * Vec3(corner & 1, (corner >> 1) & 1, (corner >> 2) & 1);
        const Vec3 apart = glm::abs(a.toIndex(b.toPatient(index)) - index);
        most = std::max({most, apart.x, apart.y, apart.z});
    }
    return most;
}

void makeFinite(const std::filesystem::path& file, std::vector<float>& values, std::vector<std::string>& warnings)
{
    float lowest = std::numeric_limits<float>::infinity();
    std::size_t bad = 0;
    for (const float v : values) {
        bad += std::isfinite(v) ? 0 : 1;
        lowest = std::isfinite(v) ? std::min(lowest, v) : lowest;
    }
    refuseIf(bad == values.size(), file, "no voxel is a number: save the image again");
    if (bad > 0) {
        std::replace_if(
            values.begin(), values.end(), [](float v) { return !std::isfinite(v); }, lowest);
        warnings.push_back(
            fmt::format("{} voxels are not numbers: the smallest value, {}, is taken for them", bad, lowest));
    }
}

}  // namespace palpate::volume
