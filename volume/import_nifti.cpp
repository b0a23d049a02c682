#include <volume/import_source.h>
#include <volume/unpack.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <regex>

namespace palpate::volume {

namespace {

constexpr std::size_t headerBytes = 348;

// The fields of a NIfTI-1 header, in either byte order. Offsets: https://nifti.nimh.nih.gov/nifti-1
class NiftiHeader {
public:
    explicit NiftiHeader(std::vector<std::byte> bytes) : bytes_(std::move(bytes))
    {
        const auto length = get<std::int32_t>(0);
        swapped_ = length != 348 && length != 540;
    }

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
    bool swapped() const { return swapped_; }
    std::string magic() const { return {reinterpret_cast<const char*>(bytes_.data()) + 344, 3}; }
    int dim(std::size_t i) const { return get<std::int16_t>(40 + 2 * i); }
    double pixdim(std::size_t i) const { return static_cast<double>(get<float>(76 + 4 * i)); }
    double number(std::size_t offset) const { return static_cast<double>(get<float>(offset)); }

private:
    std::vector<std::byte> bytes_;
    bool swapped_ = false;
};

NiftiHeader readHeader(const std::filesystem::path& file)
{
    std::vector<std::byte> bytes = unpackedBytes(file, 0, looksPacked(file, 0), 0, headerBytes);
    if (bytes.size() < headerBytes) {
        refuse(file, fmt::format("ends after {} bytes: a NIfTI header has {}", bytes.size(), headerBytes));
    }
    NiftiHeader header(std::move(bytes));
    const auto length = header.get<std::int32_t>(0);
    if (length == 540) {
        refuse(file, "is NIfTI-2: save it as NIfTI-1");
    }
    if (length != 348) {
        refuse(file, "is not a NIfTI file: its header does not begin with its length, 348");
    }
    if (header.magic() != "n+1" && header.magic() != "ni1") {
        refuse(file, "is Analyze 7.5, which does not say which side is left: save it as NIfTI");
    }
    return header;
}

Component componentOf(const std::filesystem::path& file, const NiftiHeader& header)
{
    static const std::map<int, Component> types = {
        {2, Component::u8},  {256, Component::i8},   {512, Component::u16},  {4, Component::i16},  {768, Component::u32},
        {8, Component::i32}, {1280, Component::u64}, {1024, Component::i64}, {16, Component::f32}, {64, Component::f64}};
    const int code = header.get<std::int16_t>(70);
    const int bits = header.get<std::int16_t>(72);
    if (code == 128 || code == 2304 || code == 32 || code == 1792) {
        refuse(file, "has colours or complex numbers as voxels; a label map has one integer per voxel");
    }
    const auto found = types.find(code);
    if (found == types.end()) {
        refuse(file, fmt::format("datatype {} is not one that a label map has", code));
    }
    if (static_cast<std::uint64_t>(bits) != 8 * bytesOf(found->second)) {
        refuse(file, fmt::format("datatype {} has {} bits per voxel, but bitpix says {}: its header contradicts itself",
                                 code, 8 * bytesOf(found->second), bits));
    }
    return found->second;
}

Index3 sizeOf(const std::filesystem::path& file, const NiftiHeader& header)
{
    const int dimensions = header.dim(0);
    if (dimensions < 1 || dimensions > 7) {
        refuse(file, fmt::format("dim[0] = {}: it must be 1 to 7", dimensions));
    }
    std::vector<std::int64_t> sizes;
    for (int i = 1; i <= dimensions; ++i) {
        sizes.push_back(header.dim(static_cast<std::size_t>(i)));
    }
    while (sizes.size() > 3 && sizes.back() == 1) {
        sizes.pop_back();
    }
    return checkedSize(file, sizes);
}

// RAS [mm] as NIfTI has it to LPS [m].
Affine toPatient(const Mat3& linear, const Vec3& origin, double unit)
{
    const Vec3 flip(-unit, -unit, unit);
    return {Mat3(linear[0] * flip, linear[1] * flip, linear[2] * flip), origin * flip};
}

Affine sform(const NiftiHeader& header, double unit)
{
    Mat3 linear;
    Vec3 origin;
    for (int row = 0; row < 3; ++row) {
        const std::size_t at = 280 + 16 * static_cast<std::size_t>(row);
        for (int column = 0; column < 3; ++column) {
            linear[column][row] = header.number(at + 4 * static_cast<std::size_t>(column));
        }
        origin[row] = header.number(at + 12);
    }
    return toPatient(linear, origin, unit);
}

Affine qform(const NiftiHeader& header, double unit)
{
    const double b = header.number(256);
    const double c = header.number(260);
    const double d = header.number(264);
    const double a = std::sqrt(std::max(0.0, 1.0 - b * b - c * c - d * d));
    const double handed = header.pixdim(0) < 0 ? -1.0 : 1.0;
    Mat3 r(a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c),  //
           2 * (b * c - a * d), a * a + c * c - b * b - d * d, 2 * (c * d + a * b),  //
           2 * (b * d + a * c), 2 * (c * d - a * b), a * a + d * d - c * c - b * b);
    r[0] *= std::abs(header.pixdim(1));
    r[1] *= std::abs(header.pixdim(2));
    r[2] *= std::abs(header.pixdim(3)) * handed;
    return toPatient(r, {header.number(268), header.number(272), header.number(276)}, unit);
}

// Metres in the file's unit of length.
double unitOf(const std::filesystem::path& file, const NiftiHeader& header)
{
    switch (header.get<std::uint8_t>(123) & 7) {
        case 1:
            return 1.0;
        case 0:
        case 2:
            return 1e-3;
        case 3:
            return 1e-6;
        default:
            refuse(file, fmt::format("xyzt_units = {}: the unit of length is unknown", header.get<std::uint8_t>(123)));
    }
}

// How far two placements of the same voxels are apart at most, in voxels of `a`.
double disagreement(const Affine& a, const Affine& b, Index3 size)
{
    double most = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3 index = Vec3(size - 1) * Vec3(corner & 1, (corner >> 1) & 1, (corner >> 2) & 1);
        const Vec3 apart = glm::abs(a.toIndex(b.toPatient(index)) - index);
        most = std::max({most, apart.x, apart.y, apart.z});
    }
    return most;
}

// The rule: the sform where it has a code, else the qform, else the plain axes. A warning where the first two disagree.
void place(const NiftiHeader& header, Source& source)
{
    const double unit = unitOf(source.header, header);
    const bool hasQ = header.get<std::int16_t>(252) > 0;
    const bool hasS = header.get<std::int16_t>(254) > 0;
    const Affine q = qform(header, unit);
    const Affine s = sform(header, unit);
    if (hasS) {
        source.affine = s;
        const double apart = s.voxelVolume() > 0 && hasQ ? disagreement(s, q, source.size) : 0.0;
        if (apart > 0.1) {
            source.warnings.push_back(
                fmt::format("its qform and sform disagree by up to {:.1f} voxels: the sform is used", apart));
        }
        return;
    }
    if (hasQ) {
        source.affine = q;
        return;
    }
    source.affine = Affine{
        unit * Mat3(std::abs(header.pixdim(1)), 0, 0, 0, std::abs(header.pixdim(2)), 0, 0, 0, std::abs(header.pixdim(3))),
        Vec3(0.0)};
    source.warnings.emplace_back(
        "it has neither qform nor sform, so which side is left is not known: the axes are taken as left, posterior, "
        "superior");
}

void locateData(const NiftiHeader& header, Source& source)
{
    const bool single = header.magic() == "n+1";
    source.data = source.header;
    const double start = header.number(108);
    if (!(start >= 0 && start < 1e9) || (single && start < static_cast<double>(headerBytes))) {
        refuse(source.header, fmt::format("vox_offset = {}: the voxels cannot begin there", start));
    }
    source.skip = static_cast<std::uint64_t>(start);
    if (!single) {
        std::string stem = source.header.string();
        stem = std::regex_replace(stem, std::regex("\\.(hdr|img|nii)(\\.gz)?$"), "");
        source.data = stem + ".img";
        if (!std::filesystem::is_regular_file(source.data)) {
            source.data = stem + ".img.gz";
        }
        if (!std::filesystem::is_regular_file(source.data)) {
            refuse(source.header, fmt::format("its voxels, {}.img, are not there: put that file beside it", stem));
        }
    }
    source.packed = looksPacked(source.data, 0);
}

// Label names of TotalSegmentator and Caret: <Label Key="5" ...><![CDATA[liver]]></Label> in a header extension.
std::vector<LabelName> extensionNames(const Source& source)
{
    constexpr std::uint64_t most = std::uint64_t{1} << 20;
    if (source.data != source.header || source.skip <= headerBytes + 4 || source.skip > most) {
        return {};
    }
    const std::vector<std::byte> bytes =
        unpackedBytes(source.data, 0, source.packed, headerBytes, source.skip - headerBytes);
    const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    const std::regex label("<Label\\s+Key=\"(\\d{1,5})\"[^>]*>\\s*(?:<!\\[CDATA\\[)?([^<\\]]+)");
    std::vector<LabelName> names;
    for (std::sregex_iterator it(text.begin(), text.end(), label), end; it != end; ++it) {
        const int value = std::stoi((*it)[1]);
        if (value <= 65535) {
            names.push_back({static_cast<std::uint16_t>(value), (*it)[2], ""});
        }
    }
    return names;
}

}  // namespace

Source readNifti(const std::filesystem::path& file)
{
    // An .img is opened through its header.
    const std::string asHeader = std::regex_replace(file.string(), std::regex("\\.img(\\.gz)?$"), ".hdr$1");
    Source source;
    source.format = Format::nifti;
    source.header = asHeader;
    // ITK's NIfTI reader turns NaN into 0 and aborts the program on a transform that is not finite.
    source.ours = true;
    if (!std::filesystem::is_regular_file(source.header)) {
        refuse(file, fmt::format("its header {} is not there: put that file beside it", asHeader));
    }
    const NiftiHeader header = readHeader(source.header);
    source.size = sizeOf(file, header);
    source.component = componentOf(file, header);
    source.bigEndian = header.swapped();
    const double slope = header.number(112);
    const double intercept = header.number(116);
    if (!std::isfinite(slope) || !std::isfinite(intercept)) {
        source.warnings.emplace_back("its scl_slope or scl_inter is not a number: the values are taken as they are stored");
    } else {
        source.scaled = slope != 0 && (slope != 1 || intercept != 0);
        source.slope = source.scaled ? slope : 1.0;
        source.intercept = source.scaled ? intercept : 0.0;
    }
    place(header, source);
    locateData(header, source);
    source.names = extensionNames(source);
    return source;
}

}  // namespace palpate::volume
