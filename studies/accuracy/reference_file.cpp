#include <studies/accuracy/reference_file.h>

#include <base/error.h>
#include <base/fnv.h>
#include <base/folds.h>
#include <base/inputs.h>
#include <base/mapped.h>
#include <base/outputs.h>
#include <base/vec_json.h>

#include <fmt/format.h>
#include <zlib.h>
#include <glm/gtc/type_ptr.hpp>
#include <glm/gtx/component_wise.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <iterator>
#include <optional>
#include <type_traits>
#include <vector>

// The file is one CBOR map in a zlib stream. Numbers that belong to positions are kept one component after the other, as
// differences from position to position, the bytes of equal rank together: on a lattice most of them are zero.
namespace palpate::studies {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ReferenceInfo, key, scene, tool, law, elements, speed, tets, unknowns, seconds, program)

namespace {

using nlohmann::json;
using Bytes = std::vector<std::uint8_t>;

constexpr int format = 1;
constexpr double quanta = 32000.0;
constexpr std::size_t maxBytes = 1UL << 30U;  // unpacked: a damaged file shall not fill the memory

template <typename Word>
Bytes packed(const std::vector<Word>& words)
{
    using Unsigned = std::make_unsigned_t<Word>;
    Bytes out(words.size() * sizeof(Word));
    Unsigned before = 0;
    for (std::size_t i = 0; i < words.size(); ++i) {
        const auto word = static_cast<Unsigned>(words[i]);
        const auto step = static_cast<Unsigned>(word - before);
        before = word;
        for (std::size_t b = 0; b < sizeof(Word); ++b) {
            out[b * words.size() + i] = static_cast<std::uint8_t>(step >> (8 * b));
        }
    }
    return out;
}

template <typename Word>
std::vector<Word> unpacked(const json& binary, std::size_t count)
{
    using Unsigned = std::make_unsigned_t<Word>;
    const auto& bytes = binary.get_binary();
    base::failIf(bytes.size() != count * sizeof(Word), "lists of different lengths");
    std::vector<Word> words(count);
    Unsigned before = 0;
    for (std::size_t i = 0; i < count; ++i) {
        Unsigned step = 0;
        for (std::size_t b = 0; b < sizeof(Word); ++b) {
            step =
                static_cast<Unsigned>(step | static_cast<Unsigned>(static_cast<Unsigned>(bytes[b * count + i]) << (8 * b)));
        }
        before = static_cast<Unsigned>(before + step);
        words[i] = static_cast<Word>(before);
    }
    return words;
}

json positionJson(const std::vector<Vec3f>& position)
{
    std::vector<std::uint32_t> bits;
    for (int c = 0; c < 3; ++c) {
        std::ranges::transform(position, std::back_inserter(bits),
                               [&](Vec3f p) { return std::bit_cast<std::uint32_t>(p[c]); });
    }
    return json::binary(packed(bits));
}

std::vector<Vec3f> positionOf(const json& binary, std::size_t count)
{
    const auto bits = unpacked<std::uint32_t>(binary, 3 * count);
    std::vector<Vec3f> position(count);
    for (std::size_t i = 0; i < 3 * count; ++i) {
        position[i % count][static_cast<int>(i / count)] = std::bit_cast<float>(bits[i]);
    }
    return position;
}

json stateJson(const ReferenceState& s)
{
    const auto most = base::largestOf(
        s.u, [](Vec3f u) { return glm::compMax(glm::abs(u)); }, 0.0F);
    const double quantum = most > 0.0F ? static_cast<double>(most) / quanta : 1.0;
    std::vector<std::int16_t> words;
    for (int c = 0; c < 3; ++c) {
        for (const Vec3f& u : s.u) {
            words.push_back(static_cast<std::int16_t>(std::lround(static_cast<double>(u[c]) / quantum)));
        }
    }
    return {{"pressed", s.pose.pressed},
            {"dragged", s.pose.dragged},
            {"focus", s.focus},
            {"force", s.force},
            {"energy", s.energy},
            {"largest", s.largest},
            {"strain", s.strain},
            {"residual", s.residual},
            {"sites", s.sites},
            {"quantum", quantum},
            {"u", json::binary(packed(words))}};
}

ReferenceState stateOf(const json& in, std::size_t count)
{
    ReferenceState s;
    s.pose = {in.at("pressed").get<double>(), in.at("dragged").get<double>()};
    s.focus = in.at("focus").get<Vec3>();
    s.force = in.at("force").get<Vec3>();
    s.energy = in.at("energy").get<double>();
    s.largest = in.at("largest").get<double>();
    s.strain = in.at("strain").get<double>();
    s.residual = in.at("residual").get<double>();
    s.sites = in.at("sites").get<std::uint32_t>();
    const auto quantum = in.at("quantum").get<double>();
    const auto words = unpacked<std::int16_t>(in.at("u"), 3 * count);
    s.u.resize(count);
    for (std::size_t i = 0; i < 3 * count; ++i) {
        s.u[i % count][static_cast<int>(i / count)] = static_cast<float>(quantum * words[i]);
    }
    return s;
}

json infoJson(const ReferenceInfo& i)
{
    json out = i;
    if (i.press) {
        out["body"] = i.body;
        out["press"] = {{"start", i.press->start},
                        {"inward", i.press->inward},
                        {"sideways", i.press->sideways},
                        {"press", i.press->press}};
    }
    return out;
}

ReferenceInfo infoOf(const json& in)
{
    auto i = in.get<ReferenceInfo>();
    if (const auto press = in.find("press"); press != in.end()) {
        i.body = in.at("body").get<std::string>();
        i.press = {press->at("start").get<Vec3>(), press->at("inward").get<Vec3>(), press->at("sideways").get<Vec3>(),
                   press->at("press").get<double>()};
    }
    return i;
}

std::string deflated(const Bytes& bytes)
{
    uLongf size = compressBound(bytes.size());
    std::string out(size, '\0');
    base::failIf(
        compress2(reinterpret_cast<Bytef*>(out.data()), &size, bytes.data(), bytes.size(), Z_BEST_COMPRESSION) != Z_OK,
        "reference: it cannot be packed: there is not enough memory");
    out.resize(size);
    return out;
}

Bytes inflated(const std::string& bytes)
{
    z_stream stream{};
    base::failIf(inflateInit(&stream) != Z_OK, "not enough memory");
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
    stream.avail_in = static_cast<uInt>(bytes.size());
    Bytes out;
    Bytes part(1U << 20U);
    int status = Z_OK;
    while (status == Z_OK && out.size() < maxBytes) {
        stream.next_out = part.data();
        stream.avail_out = static_cast<uInt>(part.size());
        status = inflate(&stream, Z_NO_FLUSH);
        out.insert(out.end(), part.begin(), part.end() - static_cast<std::ptrdiff_t>(stream.avail_out));
    }
    inflateEnd(&stream);
    base::failIf(status != Z_STREAM_END, "cut short, or not a reference");
    return out;
}

std::pair<Reference, ReferenceInfo> parsed(const std::string& bytes)
{
    const json in = json::from_cbor(inflated(bytes));
    if (const int is = in.at("palpate_reference").get<int>(); is != format) {
        throw base::error("it has format {}, this program reads {}", is, format);
    }
    Reference r;
    const auto count = in.at("count").get<std::size_t>();
    base::failIf(count > maxBytes / sizeof(Vec3f), "lists of different lengths");
    r.position = positionOf(in.at("position"), count);
    r.states = base::mapped<ReferenceState>(in.at("states"), [&](const json& state) { return stateOf(state, count); });
    r.nodes = in.at("nodes").get<std::size_t>();
    r.peakForce = in.at("peak_force").get<double>();
    r.strain = in.at("strain").get<double>();
    r.residual = in.at("residual").get<double>();
    return {std::move(r), infoOf(in.at("info"))};
}

// Lengths to the micrometre, directions to 1e-5: as well as another machine's rounding leaves them.
void addLength(base::Fnv& hash, double metres)
{
    hash.add(std::llround(1e6 * metres));
}

void addVector(base::Fnv& hash, Vec3 v, double unit)
{
    for (int c = 0; c < 3; ++c) {
        hash.add(std::llround(v[c] / unit));
    }
}

void addTissue(base::Fnv& hash, const volume::Tissue& tissue, double poissonCap)
{
    for (const volume::Structure& s : tissue.structures()) {
        const volume::TissueRow& row = tissue.table().rows[s.tissue];
        hash.add(s.tissue);
        hash.add(std::array{row.youngsModulus, std::min(row.poissonRatio, poissonCap), row.stiffening,
                            row.fixed ? 1.0 : 0.0, static_cast<double>(row.role)});
    }
    addVector(hash, tissue.affine().origin, 1e-7);
    for (int axis = 0; axis < 3; ++axis) {
        addVector(hash, tissue.affine().linear[axis], 1e-9);
    }
    const volume::Tissue::Reader reader(tissue);
    std::uint8_t row = 0;
    std::uint64_t length = 0;
    volume::forEachIndex(Index3(0), tissue.size() - 1, [&](Index3 voxel) {
        const std::uint8_t here = reader.tissue(tissue.affine().toPatient(Vec3(voxel)));
        if (here != row) {
            hash.add(row);
            hash.add(length);
            row = here;
            length = 0;
        }
        ++length;
    });
    hash.add(row);
    hash.add(length);
}

}  // namespace

void saveReference(const std::filesystem::path& file, const Reference& reference, const ReferenceInfo& info)
{
    json states = base::mapped<json>(reference.states, stateJson);
    const json out{{"palpate_reference", format},        {"info", infoJson(info)},
                   {"count", reference.position.size()}, {"position", positionJson(reference.position)},
                   {"states", std::move(states)},        {"nodes", reference.nodes},
                   {"peak_force", reference.peakForce},  {"strain", reference.strain},
                   {"residual", reference.residual}};
    base::writeWhole(file, deflated(json::to_cbor(out)));
}

std::pair<Reference, ReferenceInfo> loadReference(const std::filesystem::path& file)
{
    const std::optional<std::string> bytes = base::contentOf(file);
    base::failIf(!bytes, "{}: cannot be read: check its name and its permissions", file.native());
    try {
        return parsed(*bytes);
    } catch (const std::exception& e) {
        throw base::error("{}: is no reference that can be used ({}): make it anew with palpate-reference --save",
                          file.string(), e.what());
    }
}

std::string referenceKey(const volume::Tissue& tissue, const TrialPath& path, double speed, const std::string& law,
                         double poissonCap, bool withPress)
{
    base::Fnv hash;
    hash.add(referenceVersion);
    hash.addText(law);
    addLength(hash, speed);
    hash.add(path.tool.kind);
    for (const double length : {path.tool.radius, path.tool.length, withPress ? path.press : 0.0, path.drag, path.gap}) {
        addLength(hash, length);
    }
    if (withPress) {
        addVector(hash, path.start, 1e-6);
        addVector(hash, path.inward, 1e-5);
        addVector(hash, path.sideways, 1e-5);
    }
    for (const chainmail::Tie& tie : path.ties) {
        addVector(hash, tie.rest, 1e-6);
        addVector(hash, Vec3(tie.along, tie.across, 0.0), 1e-3);
    }
    addTissue(hash, tissue, poissonCap);
    return fmt::format("{:016x}", hash.value);
}

ReferencePress pressOf(const TrialPath& path)
{
    return {path.start, path.inward, path.sideways, path.press};
}

TrialPath pressedBy(TrialPath path, const ReferencePress& press)
{
    path.start = press.start;
    path.inward = press.inward;
    path.sideways = press.sideways;
    path.press = press.press;
    return path;
}

}  // namespace palpate::studies
