#include <volume/import/source.h>

#include <glm/common.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <regex>

namespace palpate::volume {

namespace {

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
        const auto r = static_cast<std::size_t>(row);
        for (int column = 0; column < 3; ++column) {
            linear[column][row] = header.srow(r, static_cast<std::size_t>(column));
        }
        origin[row] = header.srow(r, 3);
    }
    return toPatient(linear, origin, unit);
}

// No rotation where the three parts of the quaternion that are stored are longer than one.
std::optional<Affine> qform(const NiftiHeader& header, double unit)
{
    constexpr double rounding = 1e-4;
    const double stored = std::hypot(header.quaternion(0), header.quaternion(1), header.quaternion(2));
    if (!(stored <= 1.0 + rounding)) {
        return std::nullopt;
    }
    const double scale = 1.0 / std::max(1.0, stored);
    const double b = scale * header.quaternion(0);
    const double c = scale * header.quaternion(1);
    const double d = scale * header.quaternion(2);
    const double a = std::sqrt(std::max(0.0, 1.0 - b * b - c * c - d * d));
    const double handed = header.pixdim(0) < 0 ? -1.0 : 1.0;
    Mat3 r(a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c),  //
           2 * (b * c - a * d), a * a + c * c - b * b - d * d, 2 * (c * d + a * b),  //
           2 * (b * d + a * c), 2 * (c * d - a * b), a * a + d * d - c * c - b * b);
    r[0] *= std::abs(header.pixdim(1));
    r[1] *= std::abs(header.pixdim(2));
    r[2] *= std::abs(header.pixdim(3)) * handed;
    return toPatient(r, Vec3(header.quaternion(3), header.quaternion(4), header.quaternion(5)), unit);
}

// Metres in the file's unit of length.
double unitOf(const std::filesystem::path& file, const NiftiHeader& header)
{
    switch (header.units() & 7) {
        case 1:
            return 1.0;
        case 0:
        case 2:
            return 1e-3;
        case 3:
            return 1e-6;
        default:
            refuse(file, "xyzt_units = {}: the unit of length is unknown, save it again", header.units());
    }
}

// Spacings alone: the header does not say where the axes run.
void placePlain(const NiftiHeader& header, Source& source)
{
    const double unit = header.analyze() ? 1e-3 : unitOf(source.header, header);
    source.oriented = false;
    source.affine = Affine{
        unit * Mat3(std::abs(header.pixdim(1)), 0, 0, 0, std::abs(header.pixdim(2)), 0, 0, 0, std::abs(header.pixdim(3))),
        Vec3(0.0)};
}

// The rule: the sform where it has a code, else the qform, else the plain axes; a warning where the first two disagree.
void placeNifti(const NiftiHeader& header, Source& source)
{
    if (header.analyze()) {
        placePlain(header, source);
        return;
    }
    const double unit = unitOf(source.header, header);
    const bool hasQ = header.qformCode() > 0;
    const std::optional<Affine> q = qform(header, unit);
    const Affine s = sform(header, unit);
    bool hasS = header.sformCode() > 0;
    // A writer that sets the code and forgets the matrix.
    const bool empty = s.linear == Mat3(0.0);
    if (hasS && empty && hasQ && q && q->voxelVolume() > 0) {
        hasS = false;
        source.warnings.emplace_back("its sform is all zero, though it has a code: the qform is used");
    }
    if (hasS) {
        source.affine = s;
        const double apart = s.voxelVolume() > 0 && hasQ && q ? voxelsApart(s, *q, source.size) : 0.0;
        if (!(apart <= 0.1)) {
            source.warnings.push_back(
                fmt::format("its qform and sform disagree by up to {:.1f} voxels: the sform is used", apart));
        }
        return;
    }
    if (hasQ) {
        // The format allows no negative edge, and readers differ in what they make of one: a mirrored axis, or none.
        for (const std::size_t k : {1, 2, 3}) {
            refuseIf(header.pixdim(k) < 0, source.header,
                     "pixdim[{}] = {:g}: it is not known which way this axis runs, save it again", k, header.pixdim(k));
        }
        refuseIf(!q, source.header, "the quaternion of its qform is longer than one, so it is no rotation: save it again");
        source.affine = *q;
        return;
    }
    placePlain(header, source);
}

constexpr int intentLabel = 1002;  // NIFTI_INTENT_LABEL

bool isLength(const std::vector<std::byte>& bytes, std::size_t length, bool swapped)
{
    std::array<std::byte, 4> raw{};
    std::copy_n(bytes.begin(), 4, raw.begin());
    if (swapped) {
        std::reverse(raw.begin(), raw.end());
    }
    return std::bit_cast<std::int32_t>(raw) == static_cast<std::int32_t>(length);
}

NiftiHeader readNiftiHeader(const std::filesystem::path& file)
{
    const Encoding encoding = looksLike(file, 0);
    std::vector<std::byte> bytes = unpackedBytes(file, encoding, 0, NiftiHeader::secondBytes);
    refuseIf(bytes.size() < NiftiHeader::firstBytes, file,
             "ends after {} bytes, but a NIfTI header has {}: get the file again", bytes.size(), NiftiHeader::firstBytes);
    for (const bool swapped : {false, true}) {
        if (isLength(bytes, NiftiHeader::firstBytes, swapped)) {
            const std::string magic(reinterpret_cast<const char*>(bytes.data()) + 344, 3);
            const bool analyze = magic != "n+1" && magic != "ni1";
            refuseIf(analyze && lowerCase(file.string()).find(".hdr") == std::string::npos, file,
                     "is not a NIfTI file, its magic is missing: save it again");
            return NiftiHeader(std::move(bytes), false, swapped, analyze);
        }
        if (bytes.size() == NiftiHeader::secondBytes && isLength(bytes, NiftiHeader::secondBytes, swapped)) {
            NiftiHeader header(std::move(bytes), true, swapped);
            refuseIf(header.magic() != "n+2" && header.magic() != "ni2", file,
                     "is not a NIfTI-2 file, its magic is missing: save it again");
            return header;
        }
    }
    refuse(file, "is not a NIfTI file, its header does not begin with its length (348 or 540): save it again");
}

Component componentOf(const std::filesystem::path& file, const NiftiHeader& header)
{
    static const std::map<int, Component> types = {
        {2, Component::u8},  {256, Component::i8},   {512, Component::u16},  {4, Component::i16},  {768, Component::u32},
        {8, Component::i32}, {1280, Component::u64}, {1024, Component::i64}, {16, Component::f32}, {64, Component::f64}};
    const int code = header.datatype();
    refuseIf(code == 128 || code == 2304 || code == 32 || code == 1792 || code == 2048, file,
             "has colours or complex numbers as voxels: save it with one number per voxel");
    const auto found = types.find(code);
    refuseIf(found == types.end(), file, "datatype {} is not read: save it with whole or floating-point numbers", code);
    refuseIf(header.bitpix() < 0 || static_cast<std::uint64_t>(header.bitpix()) != 8 * bytesOf(found->second), file,
             "datatype {} has {} bits per voxel, but bitpix says {}: its header contradicts itself, save "
             "it again",
             code, 8 * bytesOf(found->second), header.bitpix());
    return found->second;
}

Index3 sizeOf(const std::filesystem::path& file, const NiftiHeader& header, Source& source)
{
    const std::int64_t dimensions = header.dim(0);
    refuseIf(dimensions < 1 || dimensions > 7, file,
             "dim[0] = {}, but it must be 1 to 7: its header is wrong, save it again", dimensions);
    std::vector<std::int64_t> sizes;
    for (std::int64_t i = 1; i <= dimensions; ++i) {
        sizes.push_back(header.dim(static_cast<std::size_t>(i)));
    }
    while (sizes.size() > 3 && sizes.back() == 1) {
        sizes.pop_back();
    }
    return checkedVolumes(file, sizes, source);
}

void locateData(const NiftiHeader& header, Source& source)
{
    const bool single = !header.analyze() && header.magic()[1] == '+';
    source.data = source.header;
    const double start = header.voxOffset();
    refuseIf(!(start >= 0 && start < 1e9) || (single && start < static_cast<double>(header.length())) ||
                 start != std::floor(start),
             source.header, "vox_offset = {}: the voxels cannot begin there, save it again", start);
    source.skip = static_cast<std::uint64_t>(start);
    if (!single) {
        std::string stem = source.header.string();
        stem = std::regex_replace(stem, std::regex("\\.(hdr|img|nii)(\\.gz)?$", std::regex::icase), "");
        source.data = stem + ".img";
        std::error_code error;
        if (!std::filesystem::is_regular_file(source.data, error)) {
            source.data = stem + ".img.gz";
        }
        refuseIf(!std::filesystem::is_regular_file(source.data, error), source.header,
                 "its voxels, {}.img, are not there: put that file beside it", stem);
    }
    // The first voxels of a file of its own may look like the beginning of a packed stream.
    const std::uint64_t whole = source.skip + source.elements() * bytesOf(source.component);
    const bool exact = !single && unpackedSize(source.data, 0, Encoding::raw, 0) == whole;
    source.encoding = exact ? Encoding::raw : looksLike(source.data, 0);
}

// What an element holds from `at` on, text and CDATA sections, and in `at` where its end tag is; nothing where it has none.
std::string contentOf(const std::string& text, std::size_t& at, const std::string& end)
{
    constexpr std::size_t longest = 2000;
    const std::string open = "<![CDATA[", close = "]]>";
    const std::size_t most = at + longest;
    std::string out;
    while (at < most) {
        const bool section = text.compare(at, open.size(), open) == 0;
        const std::size_t from = section ? at + open.size() : at;
        const std::size_t to = section ? text.find(close, from) : std::min(text.find(open, from), text.find(end, from));
        if (to == std::string::npos || to > most) {
            break;
        }
        out += text.substr(from, to - from);
        at = section ? to + close.size() : to;
        if (text.compare(at, end.size(), end) == 0) {
            return out;
        }
    }
    return "";
}

// Label names of TotalSegmentator and Caret: <Label Key="5" ...><![CDATA[liver]]></Label> in a header extension.
std::vector<SegmentName> extensionNames(const Source& source, std::size_t headerBytes)
{
    constexpr std::uint64_t most = std::uint64_t{1} << 20;
    if (source.data != source.header || source.skip <= headerBytes + 4 || source.skip > most) {
        return {};
    }
    const std::vector<std::byte> bytes =
        unpackedBytes(source.data, source.encoding, headerBytes, source.skip - headerBytes);
    const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    // Looked for piece by piece: std::regex needs a frame of the stack for each character of a repetition.
    const std::regex key("Key=\"(\\d{1,5})\"");
    std::vector<SegmentName> names;
    for (auto at = text.find("<Label "); at != std::string::npos; at = text.find("<Label ", at)) {
        const auto open = text.find('>', at);
        if (open == std::string::npos) {
            break;
        }
        const std::string attributes = text.substr(at, std::min<std::size_t>(open - at, 1000));
        at = open + 1;
        const std::string name = contentOf(text, at, "</Label>");
        std::smatch match;
        if (std::regex_search(attributes, match, key) && std::stoi(match[1]) <= 65535 && !name.empty()) {
            names.push_back({{static_cast<std::uint16_t>(std::stoi(match[1])), name, ""}, 0});
        }
    }
    return names;
}

void readScale(const NiftiHeader& header, Source& source)
{
    if (header.analyze()) {
        // SPM puts a factor where Analyze has nothing.
        refuseIf(header.slope() != 0 && header.slope() != 1, source.header,
                 "is Analyze 7.5 with a factor of {:g} at the place where SPM puts one, which the "
                 "format does not know: save it as NIfTI",
                 header.slope());
        return;
    }
    const double slope = header.slope();
    const double intercept = header.intercept();
    if (!std::isfinite(slope) || !std::isfinite(intercept)) {
        source.warnings.emplace_back("its scl_slope or scl_inter is not a number: the values are taken as they are stored");
        return;
    }
    source.scaled = slope != 0 && (slope != 1 || intercept != 0);
    source.slope = source.scaled ? slope : 1.0;
    source.intercept = source.scaled ? intercept : 0.0;
}

}  // namespace

Source readNifti(const std::filesystem::path& file)
{
    // An .img is opened through its header.
    Source source;
    source.header = std::regex_replace(file.string(), std::regex("\\.img(\\.gz)?$", std::regex::icase), ".hdr$1");
    if (std::error_code error; !std::filesystem::is_regular_file(source.header, error)) {
        refuse(file, "its header {} is not there: put that file beside it", source.header.string());
    }
    const NiftiHeader header = readNiftiHeader(source.header);
    source.size = sizeOf(file, header, source);
    source.component = componentOf(file, header);
    source.bigEndian = header.swapped();
    source.label = !header.analyze() && header.intent() == intentLabel;
    readScale(header, source);
    placeNifti(header, source);
    locateData(header, source);
    source.segments = extensionNames(source, header.length());
    return source;
}

}  // namespace palpate::volume
