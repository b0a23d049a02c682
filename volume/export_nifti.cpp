#include <volume/export_source.h>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstring>

namespace palpate::volume {

namespace {

constexpr int labelIntent = 1002, vectorIntent = 1007;
constexpr int caretExtension = 30;
constexpr int millimetres = 2;
constexpr int scannerFrame = 1;

struct NiftiType {
    int code = 0, bits = 0;
};

NiftiType niftiType(Component component)
{
    return component == Component::u8    ? NiftiType{2, 8}
           : component == Component::u16 ? NiftiType{512, 16}
                                         : NiftiType{16, 32};
}

// The voxels' placement in NIfTI's own frame: x to the right, y to the front, z to the head [mm].
struct RasAffine {
    Mat3 linear{1.0};
    Vec3 origin{0.0};

    explicit RasAffine(const Affine& a)
    {
        const Vec3 flip(-1e3, -1e3, 1e3);
        linear = Mat3(flip * a.linear[0], flip * a.linear[1], flip * a.linear[2]);
        origin = flip * a.origin;
    }
};

// The same as quaternion; only of axes at right angles.
struct Qform {
    bool fits = false;
    double qfac = 1;
    glm::dquat rotation{1, 0, 0, 0};

    explicit Qform(const RasAffine& affine)
    {
        Mat3 axes(glm::normalize(affine.linear[0]), glm::normalize(affine.linear[1]), glm::normalize(affine.linear[2]));
        const double skew = std::max({std::abs(glm::dot(axes[0], axes[1])), std::abs(glm::dot(axes[1], axes[2])),
                                      std::abs(glm::dot(axes[0], axes[2]))});
        fits = skew < 1e-6;
        qfac = glm::determinant(axes) < 0 ? -1.0 : 1.0;
        axes[2] *= qfac;
        rotation = glm::normalize(glm::quat_cast(axes));
        rotation = rotation.w < 0 ? -rotation : rotation;
    }
};

// A header under construction: numbers at byte offsets.
class Bytes {
public:
    explicit Bytes(std::size_t size) : bytes_(size, std::byte{0}) {}

    template <typename T>
    void set(std::size_t at, T value)
    {
        std::memcpy(bytes_.data() + at, &value, sizeof value);
    }
    void set(std::size_t at, std::string_view text) { std::memcpy(bytes_.data() + at, text.data(), text.size()); }
    std::span<const std::byte> all() const { return bytes_; }

private:
    std::vector<std::byte> bytes_;
};

// Where the fields of a version are, and the types of its numbers.
struct Nifti1 {
    using Size = std::int16_t;
    using Number = float;
    using Code = std::int16_t;
    using Offset = float;
    static constexpr std::size_t bytes = 348, dim = 40, datatype = 70, bitpix = 72, pixdim = 76, voxOffset = 108,
                                 slope = 112, units = 123, qcode = 252, scode = 254, quatern = 256, qoffset = 268,
                                 srow = 280, intent = 68, magicAt = 344;
    static constexpr std::string_view magic{"n+1\0", 4};
};
struct Nifti2 {
    using Size = std::int64_t;
    using Number = double;
    using Code = std::int32_t;
    using Offset = std::int64_t;
    static constexpr std::size_t bytes = 540, dim = 16, datatype = 12, bitpix = 14, pixdim = 104, voxOffset = 168,
                                 slope = 176, units = 500, qcode = 344, scode = 348, quatern = 352, qoffset = 376,
                                 srow = 400, intent = 504, magicAt = 4;
    static constexpr std::string_view magic{"n+2\0\r\n\032\n", 8};
};

template <typename V>
Bytes headerOf(const VoxelStream& voxels, int intent, std::size_t voxelStart)
{
    using Number = typename V::Number;
    constexpr std::size_t wide = sizeof(Number);
    const Index3 size = voxels.grid.size;
    const Vec3 spacing = voxels.grid.affine.spacing();
    const RasAffine affine(voxels.grid.affine);
    const Qform q(affine);
    const bool vectors = voxels.components > 1;

    Bytes h(V::bytes);
    h.set(0, static_cast<std::int32_t>(V::bytes));
    h.set(V::magicAt, V::magic);
    const std::array<std::int64_t, 8> dim{vectors ? 5 : 3, size.x, size.y, size.z, 1, voxels.components, 1, 1};
    const std::array<double, 8> pixdim{q.qfac, 1e3 * spacing.x, 1e3 * spacing.y, 1e3 * spacing.z, 1, 1, 1, 1};
    for (std::size_t i = 0; i < dim.size(); ++i) {
        h.set(V::dim + i * sizeof(typename V::Size), static_cast<typename V::Size>(dim[i]));
        h.set(V::pixdim + i * wide, static_cast<Number>(pixdim[i]));
    }
    h.set(V::intent, static_cast<typename V::Code>(intent));
    h.set(V::datatype, static_cast<std::int16_t>(niftiType(voxels.component).code));
    h.set(V::bitpix, static_cast<std::int16_t>(niftiType(voxels.component).bits));
    h.set(V::voxOffset, static_cast<typename V::Offset>(voxelStart));
    h.set(V::slope, static_cast<Number>(1));
    h.set(V::units, static_cast<std::uint8_t>(millimetres));
    h.set(V::qcode, static_cast<typename V::Code>(q.fits ? scannerFrame : 0));
    h.set(V::scode, static_cast<typename V::Code>(scannerFrame));
    const std::array<double, 3> quatern{q.rotation.x, q.rotation.y, q.rotation.z};
    for (int k = 0; k < 3; ++k) {
        const auto i = static_cast<std::size_t>(k);
        h.set(V::quatern + i * wide, static_cast<Number>(quatern[i]));
        h.set(V::qoffset + i * wide, static_cast<Number>(affine.origin[k]));
        for (int axis = 0; axis < 3; ++axis) {
            h.set(V::srow + (4 * i + static_cast<std::size_t>(axis)) * wide, static_cast<Number>(affine.linear[axis][k]));
        }
        h.set(V::srow + (4 * i + 3) * wide, static_cast<Number>(affine.origin[k]));
    }
    return h;
}

// Text in a CDATA section, which it must not end.
std::string characterData(const std::string& text)
{
    std::string out = "<![CDATA[";
    std::size_t at = 0;
    for (auto end = text.find("]]>"); end != std::string::npos; end = text.find("]]>", at)) {
        out += text.substr(at, end + 2 - at) + "]]><![CDATA[";
        at = end + 2;
    }
    return out + text.substr(at) + "]]>";
}

// Caret's label table, which TotalSegmentator and Connectome Workbench write too.
std::string labelTable(std::span<const ExportedSegment> segments)
{
    std::string out =
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<CaretExtension>\n<VolumeInformation Index=\"0\">\n"
        "<LabelTable>\n";
    for (const ExportedSegment& s : segments) {
        const auto colour = s.label.colour.value_or(std::array<std::uint8_t, 3>{128, 128, 128});
        out += fmt::format("<Label Key=\"{}\" Red=\"{:.9g}\" Green=\"{:.9g}\" Blue=\"{:.9g}\" Alpha=\"1\">{}</Label>\n",
                           s.label.value, colour[0] / 255.0, colour[1] / 255.0, colour[2] / 255.0,
                           characterData(s.label.name));
    }
    return out + "</LabelTable>\n<VolumeType><![CDATA[Label]]></VolumeType>\n</VolumeInformation>\n</CaretExtension>\n";
}

// Size, code and text of an extension, padded with zeros to a multiple of 16 bytes.
std::string extensionOf(const std::string& text)
{
    const auto size = static_cast<std::int32_t>((8 + text.size() + 15) / 16 * 16);
    const std::int32_t code = caretExtension;
    std::string out(static_cast<std::size_t>(size), '\0');
    std::memcpy(out.data(), &size, 4);
    std::memcpy(out.data() + 4, &code, 4);
    std::memcpy(out.data() + 8, text.data(), text.size());
    return out;
}

template <typename V>
void writeVersion(OutputFile& out, const VoxelStream& voxels, std::span<const ExportedSegment> segments,
                  const ExportOptions& options)
{
    const std::string extension = segments.empty() ? "" : extensionOf(labelTable(segments));
    // The four bytes that say whether there is an extension, and what fills up to a multiple of 16.
    const std::size_t start = (V::bytes + 4 + extension.size() + 15) / 16 * 16;
    const int intent = voxels.components > 1 ? vectorIntent : voxels.component == Component::f32 ? 0 : labelIntent;
    out.write(headerOf<V>(voxels, intent, start).all());
    std::string rest(start - V::bytes, '\0');
    rest[0] = extension.empty() ? '\0' : '\1';
    rest.replace(4, extension.size(), extension);
    out.write(rest);
    writeSlices(out, voxels, true, options);
}

}  // namespace

void writeNifti(const std::filesystem::path& file, const VoxelStream& voxels, std::span<const ExportedSegment> segments,
                const ExportOptions& options)
{
    const Index3 size = voxels.grid.size;
    refuseIf(!options.nifti2 && std::max({size.x, size.y, size.z}) > 32767, file,
             "NIfTI-1 has no more than 32767 voxels along a side: write NIfTI-2 (--nifti2), or .nrrd");
    OutputFile out(file);
    std::string ending = file.extension().string();
    std::transform(ending.begin(), ending.end(), ending.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    out.begin(ending == ".gz" ? Packing::gzip : Packing::none);
    if (options.nifti2) {
        writeVersion<Nifti2>(out, voxels, segments, options);
    } else {
        writeVersion<Nifti1>(out, voxels, segments, options);
    }
    out.finish();
}

}  // namespace palpate::volume
