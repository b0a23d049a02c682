#include <datasets/insert.h>

#include <base/ct_number.h>
#include <base/error.h>
#include <base/mapped.h>
#include <base/split.h>
#include <datasets/phantom_parts.h>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <limits>
#include <string>

namespace palpate::datasets {

namespace {

using volume::LabelImage;
using volume::Role;
using volume::Tissue;

constexpr int surfaceSamples = 200;  // of a lesion that looks for room

std::vector<volume::LabelName> namesOf(const Tissue& tissue)
{
    return base::mapped<volume::LabelName>(tissue.structures(), [&](const volume::Structure& s) {
        return volume::LabelName{s.value, s.name, tissue.table().rows[s.tissue].name, s.colour, s.terminology};
    });
}

// Whether a point [m] lies in an insert.
class Shape {
public:
    explicit Shape(const Insert& insert) : insert_(insert), end_(insert.to.value_or(insert.centre))
    {
        if (insert.spiculated) {
            Random random(insert.seed);
            lump_ = makeLump(insert.tissue, insert.diameter * 1e3, random);
        }
    }

    double bound() const noexcept { return insert_.spiculated ? lump_.bound * 1e-3 : insert_.diameter / 2; }
    Vec3 low() const noexcept { return glm::min(insert_.centre, end_) - bound(); }
    Vec3 high() const noexcept { return glm::max(insert_.centre, end_) + bound(); }

    bool holds(Vec3 p) const noexcept
    {
        const Vec3 along = end_ - insert_.centre;
        const double length2 = glm::dot(along, along);
        const double t = length2 > 0.0 ? std::clamp(glm::dot(p - insert_.centre, along) / length2, 0.0, 1.0) : 0.0;
        const Vec3 away = p - (insert_.centre + t * along);
        const double distance = glm::length(away);
        if (!insert_.spiculated || distance <= 0.0) {
            return distance <= insert_.diameter / 2;
        }
        return distance * 1e3 < lump_.reach(away / distance);
    }

private:
    const Insert& insert_;
    Vec3 end_;
    Lump lump_;
};

// What is put in is as stiff as the table says, and in CT it looks as its tissue does: `numberOf` has its label's number,
// and NaN for all others.
void drawIn(volume::CompanionImage& companion, const LabelImage& image, const std::vector<float>& numberOf)
{
    const bool isCt = companion.unit == "HU";
    for (std::size_t label = 0; label < numberOf.size(); ++label) {
        if (!std::isnan(numberOf[label])) {
            companion.stiffness.notOf.push_back(static_cast<std::uint16_t>(label));
        }
    }
    for (std::size_t i = 0; isCt && i < image.values.size(); ++i) {
        const float number = numberOf[image.values[i]];
        companion.values[i] = std::isnan(number) ? companion.values[i] : number;
    }
}

// Gives the voxels of the shape that hold tissue a new label; returns how many. `inside` says by label what holds tissue.
std::size_t draw(LabelImage& image, const Shape& shape, const std::vector<char>& inside, std::uint16_t label)
{
    const Vec3 low = shape.low(), high = shape.high();
    Vec3 first(1e9), last(-1e9);
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3 p((corner & 1) != 0 ? high.x : low.x, (corner & 2) != 0 ? high.y : low.y,
                     (corner & 4) != 0 ? high.z : low.z);
        const Vec3 index = image.affine.toIndex(p);
        first = glm::min(first, index);
        last = glm::max(last, index);
    }
    const Index3 from = glm::clamp(Index3(glm::floor(first)), Index3(0), image.size - 1);
    const Index3 to = glm::clamp(Index3(glm::ceil(last)), Index3(0), image.size - 1);
    std::size_t count = 0;
    volume::forEachIndex(from, to, [&](Index3 n) {
        std::uint16_t& value = image.values[image.offset(n)];
        if (inside[value] != 0 && shape.holds(image.affine.toPatient(Vec3(n)))) {
            value = label;
            ++count;
        }
    });
    return count;
}

// Whether the voxel around a point holds tissue.
bool amidTissue(const LabelImage& image, Vec3 p, const std::vector<char>& inside)
{
    const Index3 n(glm::round(image.affine.toIndex(p)));
    return n == glm::clamp(n, Index3(0), image.size - 1) && inside[image.values[image.offset(n)]] != 0;
}

bool roomFor(const Tissue& tissue, const Tissue::Reader& reader, const Insert& lesion)
{
    const double radius = Shape(lesion).bound();
    Random random(1);
    for (int i = 0; i < surfaceSamples; ++i) {
        const Vec3 d = random.direction();
        for (const double fraction : {0.5, 1.0}) {
            const auto& row = tissue.table().rows[reader.tissue(lesion.centre + fraction * radius * d)];
            if (row.role == Role::air || row.role == Role::skin || row.role == Role::bone || row.fixed) {
                return false;
            }
        }
    }
    return true;
}

// The one after the highest in use, else the lowest that is free.
std::uint16_t freeLabel(const std::vector<bool>& used, const std::string& insert)
{
    const std::ptrdiff_t afterHighest = std::find(used.rbegin(), used.rend(), true).base() - used.begin();
    const auto next =
        used.begin() + afterHighest < used.end() ? used.begin() + afterHighest : std::ranges::find(used, false);
    base::failIf(next == used.end(), "insert '{}': every label value from 1 to 65535 is in use: save the labels with fewer",
                 insert);
    return static_cast<std::uint16_t>(next - used.begin());
}

Vec3 parsePoint(const std::string& line, const std::string& where)
{
    Vec3 p(0.0);
    const char* at = line.data();
    const char* const end = line.data() + line.find_last_not_of(" \t\r") + 1;
    for (int axis = 0; axis < 3; ++axis) {
        const auto number = base::withoutPlus({at, end});
        const auto [rest, error] = std::from_chars(number.data(), end, p[axis]);
        const bool separated = axis == 2 ? rest == end : rest != end && *rest == ',';
        base::failIf(error != std::errc() || !separated || !(std::abs(p[axis]) <= farthestCoordinate),
                     "{}: '{}': must be three numbers x,y,z [mm], each -{:g} to {:g}", where, line, farthestCoordinate,
                     farthestCoordinate);
        at = rest + 1;
    }
    return p * 1e-3;
}

}  // namespace

Tissue withInserts(const Tissue& tissue, std::span<const Insert> inserts)
{
    LabelImage image = tissue.labels();
    std::vector<volume::LabelName> names = namesOf(tissue);
    std::vector<char> inside(65536, 0);
    std::vector<bool> used(65536, false);
    used[0] = true;  // air
    for (const volume::Structure& s : tissue.structures()) {
        inside[s.value] = tissue.table().rows[s.tissue].role == Role::air ? 0 : 1;
        used[s.value] = true;
    }
    auto provenance = tissue.provenance();
    std::vector<float> numberOf(65536, std::numeric_limits<float>::quiet_NaN());
    for (const Insert& insert : inserts) {
        base::failIf(!tissue.table().find(insert.tissue), "insert '{}': tissue '{}' is not in the volume's tissue table",
                     insert.name, insert.tissue);
        const bool known = std::any_of(names.begin(), names.end(), [&](const auto& n) { return n.name == insert.name; });
        base::failIf(known, "insert '{}': the volume has a structure of this name: choose another name", insert.name);
        const std::uint16_t label = freeLabel(used, insert.name);
        if (draw(image, Shape(insert), inside, label) == 0) {
            const Vec3 c = insert.centre * 1e3;
            base::failIf(
                amidTissue(image, insert.centre, inside),
                "insert '{}' at [{:g}, {:g}, {:g}] mm: with {:g} mm it holds the middle of no voxel: make it larger, or "
                "the voxels smaller",
                insert.name, c.x, c.y, c.z, 1e3 * insert.diameter);
            throw base::error("insert '{}' at [{:g}, {:g}, {:g}] mm: there is no tissue of the volume", insert.name, c.x,
                              c.y, c.z);
        }
        numberOf[label] = base::ctNumberOf(tissue.table().rows[*tissue.table().find(insert.tissue)].density);
        names.push_back({label, insert.name, insert.tissue});
        used[label] = true;
        inside[label] = 1;
        provenance.emplace_back("insert", insert.name);
    }
    auto companion = tissue.companion();
    if (companion) {
        drawIn(*companion, image, numberOf);
    }
    return Tissue::fromLabels(image, tissue.table(), names, std::move(provenance), companion ? &*companion : nullptr);
}

Tissue withTable(const Tissue& tissue, volume::TissueTable table)
{
    const auto companion = tissue.companion();
    return Tissue::fromLabels(tissue.labels(), std::move(table), namesOf(tissue), tissue.provenance(),
                              companion ? &*companion : nullptr);
}

std::vector<Vec3> loadLocations(const std::filesystem::path& file)
{
    std::ifstream in(file);
    base::failIf(!in, "{}: locations cannot be read: give the .loc file of the phantom", file.native());
    std::vector<Vec3> places;
    std::string line;
    for (int number = 1; std::getline(in, line); ++number) {
        if (line.find_first_not_of(" \t\r") != std::string::npos) {
            places.push_back(parsePoint(line, fmt::format("{}:{}", file.string(), number)));
        }
    }
    base::failIf(places.empty(), "{}: holds no locations, one x,y,z [mm] per line", file.native());
    return places;
}

Insert placeLesion(const Tissue& tissue, const std::filesystem::path& locations, Insert lesion)
{
    const std::vector<Vec3> places = loadLocations(locations);
    const Tissue::Reader reader(tissue);
    const std::size_t first = Random(lesion.seed).bits() % places.size();
    for (std::size_t i = 0; i < places.size(); ++i) {
        lesion.centre = places[(first + i) % places.size()];
        if (roomFor(tissue, reader, lesion)) {
            return lesion;
        }
    }
    throw base::error(
        "{}: at none of its {} places does a lesion of {:g} mm lie wholly in the volume's tissue: is it of this "
        "volume? else choose a smaller one",
        locations.string(), places.size(), lesion.diameter * 1e3);
}

Insert placeLesionIn(const Tissue& tissue, const std::string& structure, Insert lesion)
{
    constexpr std::size_t maxNodes = 4'000'000;
    const Vec3 voxel = tissue.affine().spacing();
    const double wanted = std::max(std::min({voxel.x, voxel.y, voxel.z}), lesion.diameter / 8);
    const volume::NodeGrid grid = volume::affordableGrid(tissue.box(), wanted, maxNodes);
    const volume::DistanceField field = tissue.distanceTo(tissue.labelsNamed(structure), grid);
    const double radius = Shape(lesion).bound();
    std::vector<std::size_t> places;
    for (std::size_t i = 0; i < field.values.size(); ++i) {
        if (static_cast<double>(field.values[i]) < -radius) {
            places.push_back(i);
        }
    }
    if (places.empty()) {
        const float deepest = *std::min_element(field.values.begin(), field.values.end());
        throw base::error("'{}' has no room for a lesion {:g} mm across: {:.0f} mm fit in at most", structure, 2e3 * radius,
                          std::max(0.0, -2e3 * static_cast<double>(deepest)));
    }
    Random random(lesion.seed);
    lesion.centre = grid.position(grid.node(places[random.bits() % places.size()]));
    return lesion;
}

}  // namespace palpate::datasets
