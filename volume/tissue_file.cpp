#include <base/mapped.h>
#include <volume/image_check.h>
#include <volume/table_check.h>
#include <volume/tissue.h>
#include <volume/tissue_impl.h>

#include <base/cells.h>
#include <base/error.h>
#include <base/inputs.h>
#include <base/outputs.h>
#include <base/vec_json.h>

#include <fmt/format.h>
#include <openvdb/io/Archive.h>
#include <openvdb/io/Stream.h>
#include <glm/vector_relational.hpp>
#include <nlohmann/json.hpp>

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <mutex>

namespace palpate::volume {

namespace {

using nlohmann::json;

constexpr const char* metadataKey = "palpate_volume";
constexpr int formatVersion = 2;  // since 2 an image may scale the stiffness

// OpenVDB's registry of grid types must be filled once before anything is read.
void initialise()
{
    static std::once_flag once;
    std::call_once(once, [] { openvdb::initialize(); });
}

json toJson(const Acoustics& a)
{
    return {{"sound_speed_m_s", a.soundSpeed},
            {"attenuation_db_cm", a.attenuation},
            {"attenuation_power", a.attenuationPower},
            {"echo_db", a.echo},
            {"echo_variation_db", a.echoVariation},
            {"echo_pattern", std::string(echoPatterns[static_cast<std::size_t>(a.pattern)])},
            {"source", a.source}};
}

Acoustics acousticsFrom(const json& j)
{
    Acoustics a;
    a.soundSpeed = j.at("sound_speed_m_s").get<double>();
    a.attenuation = j.at("attenuation_db_cm").get<double>();
    a.attenuationPower = j.at("attenuation_power").get<double>();
    a.echo = j.at("echo_db").get<double>();
    a.echoVariation = j.at("echo_variation_db").get<double>();
    const auto pattern = j.at("echo_pattern").get<std::string>();
    const auto* const found = std::find(echoPatterns.begin(), echoPatterns.end(), pattern);
    base::failIf(found == echoPatterns.end(), "unknown echo pattern '{}'", pattern);
    a.pattern = static_cast<EchoPattern>(found - echoPatterns.begin());
    a.source = j.at("source").get<std::string>();
    return a;
}

json toJson(const TissueRow& row)
{
    json out{{"name", row.name},
             {"role", std::string(name(row.role))},
             {"youngs_pa", row.youngsModulus},
             {"poisson", row.poissonRatio},
             {"stiffening", row.stiffening},
             {"density_kg_m3", row.density},
             {"compress", row.compress},
             {"stretch", row.stretch},
             {"shear", row.shear},
             {"puncture_n", row.punctureForce},
             {"cutting_n", row.cuttingForce},
             {"friction_n_m", row.frictionPerMetre},
             {"stiction_n_m", row.stictionPerMetre},
             {"friction_ns_m2", row.frictionDamping},
             {"fixed", row.fixed},
             {"colour", json::array({row.colour.r, row.colour.g, row.colour.b})},
             {"opacity", row.opacity},
             {"source", row.source}};
    if (row.relaxation().any()) {
        out["relaxing_fast"] = row.relaxingFast;
        out["relaxing_slow"] = row.relaxingSlow;
        out["relaxation_source"] = row.relaxationSource;
    }
    if (row.wallSpacing > 0.0) {
        out["wall_spacing_m"] = row.wallSpacing;
        out["wall_n"] = row.wallForce;
        out["wall_source"] = row.wallSource;
    }
    if (row.acoustics.given()) {
        out["acoustics"] = toJson(row.acoustics);
    }
    return out;
}

TissueRow rowFrom(const json& j)
{
    const auto role = roleNamed(j.at("role").get<std::string>());
    base::failIf(!role, "unknown role '{}'", j.at("role").get<std::string>());
    const json& colour = j.at("colour");
    TissueRow row;
    row.name = j.at("name").get<std::string>();
    row.role = *role;
    row.youngsModulus = j.at("youngs_pa").get<double>();
    row.poissonRatio = j.at("poisson").get<double>();
    row.stiffening = j.value("stiffening", 0.0);
    row.density = j.at("density_kg_m3").get<double>();
    row.compress = j.at("compress").get<double>();
    row.stretch = j.at("stretch").get<double>();
    row.shear = j.at("shear").get<double>();
    row.punctureForce = j.at("puncture_n").get<double>();
    row.cuttingForce = j.at("cutting_n").get<double>();
    row.frictionPerMetre = j.at("friction_n_m").get<double>();
    row.stictionPerMetre = j.value("stiction_n_m", 0.0);
    row.frictionDamping = j.value("friction_ns_m2", 0.0);
    row.relaxingFast = j.value("relaxing_fast", 0.0);
    row.relaxingSlow = j.value("relaxing_slow", 0.0);
    row.relaxationSource = j.value("relaxation_source", std::string());
    row.wallSpacing = j.value("wall_spacing_m", 0.0);
    row.wallForce = j.value("wall_n", 0.0);
    row.wallSource = j.value("wall_source", std::string());
    row.fixed = j.at("fixed").get<bool>();
    row.colour = {colour.at(0).get<float>(), colour.at(1).get<float>(), colour.at(2).get<float>()};
    row.opacity = j.at("opacity").get<float>();
    row.source = j.at("source").get<std::string>();
    if (const auto acoustics = j.find("acoustics"); acoustics != j.end()) {
        row.acoustics = acousticsFrom(*acoustics);
    }
    return row;
}

// Everything that the grids do not hold. JSON numbers keep all 17 digits of a double.
json describe(const TissueData& t)
{
    const json rows = base::mapped<json>(t.table.rows, [](const TissueRow& row) { return toJson(row); });
    json structures = json::array();
    for (std::size_t i = 0; i < t.structures.size(); ++i) {
        const Structure& s = t.structures[i];
        structures.push_back({{"value", s.value},
                              {"name", s.name},
                              {"tissue", t.table.rows[s.tissue].name},
                              {"voxels", s.voxels},
                              {"low", t.extents[i].low},
                              {"high", t.extents[i].high}});
        if (s.colour) {
            structures.back()["colour"] = *s.colour;
        }
        if (!s.terminology.empty()) {
            structures.back()["terminology"] = s.terminology;
        }
    }
    json out{{"format", t.stiffnessMap.points.empty() ? 1 : formatVersion},
             {"size", t.size},
             {"steps_m", {t.affine.linear[0], t.affine.linear[1], t.affine.linear[2]}},
             {"origin_m", t.affine.origin},
             {"table", {{"name", t.table.name}, {"rows", rows}}},
             {"structures", structures},
             {"provenance", t.provenance}};
    if (t.image) {
        out["image"] = {{"unit", t.imageUnit},
                        {"stiffness_points", t.stiffnessMap.points},
                        {"stiffness_tissues", t.stiffnessMap.tissues}};
        if (!t.stiffnessMap.notOf.empty()) {
            out["image"]["stiffness_not_of"] = t.stiffnessMap.notOf;
        }
    }
    return out;
}

void readStructures(const json& list, TissueData& t)
{
    for (const json& j : list) {
        const auto tissue = j.at("tissue").get<std::string>();
        const auto row = t.table.find(tissue);
        base::failIf(!row, "structure of unknown tissue '{}'", tissue);
        const auto voxels = j.at("voxels").get<std::uint64_t>();
        t.structures.push_back({j.at("value").get<std::uint16_t>(), j.at("name").get<std::string>(), *row, voxels,
                                static_cast<double>(voxels) * t.affine.voxelVolume()});
        if (j.contains("colour")) {
            t.structures.back().colour = j.at("colour").get<std::array<std::uint8_t, 3>>();
        }
        t.structures.back().terminology = j.value("terminology", "");
        const IndexBox extent{j.at("low").get<Index3>(), j.at("high").get<Index3>()};
        const auto isIn = [&](Index3 n) {
            return glm::all(glm::greaterThanEqual(n, Index3(0))) && glm::all(glm::lessThan(n, t.size));
        };
        base::failIf(extent.empty() || !isIn(extent.low) || !isIn(extent.high),
                     "structure '{}' lies outside of the voxels: it is damaged, make it again", t.structures.back().name);
        t.extents.push_back(extent);
    }
}

void readDescription(const json& j, TissueData& t)
{
    const int version = j.at("format").get<int>();
    base::failIf(version > formatVersion, "format {} is newer than this program reads ({}): use a newer palpate", version,
                 formatVersion);
    t.size = j.at("size").get<Index3>();
    const json& steps = j.at("steps_m");
    t.affine.linear = Mat3(steps.at(0).get<Vec3>(), steps.at(1).get<Vec3>(), steps.at(2).get<Vec3>());
    t.affine.origin = j.at("origin_m").get<Vec3>();
    t.table.name = j.at("table").at("name").get<std::string>();
    t.table.rows = base::mapped<TissueRow>(j.at("table").at("rows"), rowFrom);
    t.provenance = j.at("provenance").get<Provenance>();
    checkGrid(t.size, t.affine);
    checkTable(t.table);
    readStructures(j.at("structures"), t);
    if (j.contains("image")) {
        const json& image = j.at("image");
        t.imageUnit = image.at("unit").get<std::string>();
        t.stiffnessMap.points = image.at("stiffness_points").get<std::vector<std::pair<double, double>>>();
        t.stiffnessMap.tissues = image.at("stiffness_tissues").get<std::vector<std::string>>();
        t.stiffnessMap.notOf = image.value("stiffness_not_of", std::vector<std::uint16_t>());
    }
}

// openvdb::io::File does not report a failed write; this writes the same bytes through a stream that throws.
class Writer : public openvdb::io::Archive {
public:
    void write(std::ostream& out, const openvdb::GridCPtrVec& grids, const openvdb::MetaMap& meta) const
    {
        Archive::write(out, grids, true, meta);
    }
};

void writeFile(const std::filesystem::path& file, const TissueData& t)
{
    openvdb::MetaMap meta;
    meta.insertMeta(metadataKey, openvdb::StringMetadata(describe(t).dump(-1, ' ', false, json::error_handler_t::replace)));
    meta.insertMeta("creator", openvdb::StringMetadata("palpate"));
    std::ofstream out;
    out.exceptions(std::ios::failbit | std::ios::badbit);
    out.open(file, std::ios::binary | std::ios::trunc);
    openvdb::GridCPtrVec grids{t.label, t.stiffness, t.occupancy};
    if (t.image) {
        grids.push_back(t.image);
    }
    Writer().write(out, grids, meta);
    out.close();
}

// A stream that ends early throws instead of handing out zeros.
openvdb::GridPtrVecPtr readGrids(const std::filesystem::path& file, json& description)
{
    std::ifstream in(file, std::ios::binary);
    std::uint32_t magic = 0;
    in.read(reinterpret_cast<char*>(&magic), sizeof magic);
    base::failIf(!in || magic != static_cast<std::uint32_t>(openvdb::OPENVDB_MAGIC),
                 "is not an OpenVDB file: import a label map with 'palpate import' first");
    in.seekg(0);
    in.exceptions(std::ios::failbit | std::ios::badbit);
    openvdb::io::Stream stream(in, false);
    const openvdb::MetaMap::Ptr meta = stream.getMetadata();
    const auto text = meta ? meta->getMetadata<openvdb::StringMetadata>(metadataKey) : nullptr;
    base::failIf(!text, "is an OpenVDB file, but not one of palpate: make it with 'palpate import' or 'phantom'");
    description = json::parse(text->value());
    return stream.getGrids();
}

template <typename Grid>
typename Grid::Ptr gridNamed(const openvdb::GridPtrVec& grids, const std::string& name)
{
    for (const auto& grid : grids) {
        if (grid->getName() == name && grid->isType<Grid>()) {
            return openvdb::gridPtrCast<Grid>(grid);
        }
    }
    throw base::error("has no grid '{}': it is damaged", name);
}

// The counts in the description against the voxels that were read.
void checkCounts(const TissueData& t)
{
    std::uint64_t described = 0;
    std::uint64_t nonzero = 0;
    std::uint64_t solid = 0;
    for (const Structure& s : t.structures) {
        described += s.voxels;
        nonzero += s.value != 0 ? s.voxels : 0;
        solid += t.lookup.solid[s.value] != 0 ? s.voxels : 0;
    }
    base::failIf(described != base::countOf(t.size) || nonzero != t.label->activeVoxelCount() ||
                     solid != t.occupancy->activeVoxelCount(),
                 "its voxels do not add up to what its table says: it is damaged, make it again");
}

std::string reasonOf(const std::exception& e)
{
    if (dynamic_cast<const std::ios_base::failure*>(&e) != nullptr) {
        return "is cut short or damaged: make it again";
    }
    if (dynamic_cast<const json::exception*>(&e) != nullptr) {
        return "is damaged (what it says of itself cannot be read): make it again";  // what() quotes bytes of any kind
    }
    if (dynamic_cast<const openvdb::Exception*>(&e) != nullptr) {
        return fmt::format("is damaged ({}): make it again", e.what());
    }
    return e.what();
}

}  // namespace

void Tissue::save(const std::filesystem::path& file) const
{
    initialise();
    const std::filesystem::path place = base::replaceable(file);
    const std::filesystem::path beside = fmt::format("{}.{}.part", place.string(), ::getpid());
    errno = 0;
    try {
        writeFile(beside, *impl_);
        std::filesystem::rename(beside, place);
    } catch (const std::exception& e) {
        const std::string why = errno != 0 ? std::strerror(errno) : e.what();
        std::error_code ignored;
        std::filesystem::remove(beside, ignored);
        throw base::error("{}: cannot be written ({}): check the folder and the space on the disk", file.string(), why);
    }
}

Tissue Tissue::load(const std::filesystem::path& file)
{
    initialise();
    const std::string why = base::whyNoFile(file);
    base::failIf(!why.empty(), "{}: {}", file.string(), why);
    auto impl = std::make_unique<Impl>();
    try {
        json description;
        const auto grids = readGrids(file, description);
        readDescription(description, *impl);
        impl->label = gridNamed<openvdb::Int32Grid>(*grids, "label");
        impl->stiffness = gridNamed<openvdb::FloatGrid>(*grids, "stiffness");
        impl->occupancy = gridNamed<openvdb::BoolGrid>(*grids, "occupancy");
        if (description.contains("image")) {
            impl->image = gridNamed<openvdb::FloatGrid>(*grids, "image");
        }
        impl->derive();
        checkCounts(*impl);
    } catch (const std::exception& e) {
        throw base::error("{}: {}", file.string(), reasonOf(e));
    }
    return Tissue(std::move(impl));
}

}  // namespace palpate::volume
