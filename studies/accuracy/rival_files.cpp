#include <studies/accuracy/rival_files.h>

#include <base/error.h>
#include <base/outputs.h>
#include <base/split.h>
#include <base/vec_json.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

namespace palpate::studies {

std::string lastLine(const std::filesystem::path& log)
{
    constexpr std::size_t longest = 200;
    std::ifstream in(log);
    std::string last;
    for (std::string line; std::getline(in, line);) {
        last = base::trimmed(line).empty() ? last : std::string(base::trimmed(line));
    }
    std::ranges::replace_if(
        last, [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
    return last.substr(0, longest);
}

using nlohmann::json;

namespace {

constexpr int fileFormat = 1;       // of push.json
constexpr double rivalTick = 1e-3;  // of schedule() [s]
constexpr double density = 1e3;     // of all tissue, for what has inertia [kg/m^3]
constexpr double largest = 1e6;     // of any number of an answer, in SI: beyond, a solver has run away

// The tissues' elastic constants, each once, and which of them each tetrahedron has.
void addMaterials(json& push, const TetBody& mesh)
{
    std::map<std::pair<double, double>, std::size_t> found;
    json materials = json::array(), own = json::array();
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const double mu = mesh.mu[t], lambda = mesh.lambda[t];
        const auto [at, isNew] = found.emplace(std::pair(mu, lambda), found.size());
        if (isNew) {
            materials.push_back({{"youngs_modulus_pa", mu * (3.0 * lambda + 2.0 * mu) / (lambda + mu)},
                                 {"poisson_ratio", lambda / (2.0 * (lambda + mu))}});
        }
        own.push_back(at->second);
    }
    push["materials"] = std::move(materials);
    push["tet_material"] = std::move(own);
}

void addMesh(json& push, const TetBody& mesh)
{
    json points = json::array(), held = json::array();
    for (std::size_t p = 0; p < mesh.points.size(); ++p) {
        points.push_back(mesh.points[p]);
        if (mesh.held[p] != 0) {
            held.push_back(p);
        }
    }
    push["points_m"] = std::move(points);
    push["held_points"] = std::move(held);
    push["tets"] = mesh.tets;
    push["surface_triangles"] = outsideOf(mesh);
}

void addPath(json& push, const AccuracySubject& subject)
{
    json centres = json::array(), looks = json::array();
    for (const TrialTick& t : schedule(subject.path, subject.speed)) {
        if (t.look) {
            looks.push_back(centres.size());
        }
        centres.push_back(subject.path.at(t.pose));
    }
    push["tool"] = {{"kind", "sphere"}, {"radius_m", subject.path.tool.radius}, {"friction", 0.0}};
    push["tick_s"] = rivalTick;
    push["tool_centre_m"] = std::move(centres);
    push["look_ticks"] = std::move(looks);
}

// A table of numbers under a head line. Row by row through `take`, which is told the cells.
template <typename Take>
std::size_t readTable(const std::filesystem::path& file, std::string_view head, std::size_t most, Take&& take)
{
    const std::string name = file.filename().string();
    std::ifstream in(file);
    base::failIf(!in || std::filesystem::is_directory(file), "{}: was not written", name);
    const std::size_t columns = base::csvCells(head).size();
    std::string line;
    base::failIf(!std::getline(in, line) || base::csvCells(line) != base::csvCells(head), "{}: its first line must be {}",
                 name, head);
    std::size_t rows = 0;
    std::vector<double> numbers(columns);
    for (std::size_t number = 2; std::getline(in, line); ++number) {
        if (base::trimmed(line).empty()) {
            continue;
        }
        const auto cells = base::csvCells(line);
        base::failIf(cells.size() != columns, "{}: line {}: {} values: must be {}", name, number, cells.size(), head);
        for (std::size_t c = 0; c < columns; ++c) {
            const std::optional<double> value = base::numberIn(cells[c]);
            base::failIf(!value || !(std::abs(*value) <= largest), "{}: line {}: '{}': must be a finite number", name,
                         number, cells[c]);
            numbers[c] = *value;
        }
        base::failIf(++rows > most, "{}: line {}: more than {} rows", name, number, most);
        take(std::span<const double>(numbers));
    }
    return rows;
}

void checkRows(const std::filesystem::path& file, std::size_t rows, std::size_t wanted, const std::string& ofWhat)
{
    base::failIf(rows != wanted, "{}: {} rows: must be {}, {}", file.filename().string(), rows, wanted, ofWhat);
}

}  // namespace

std::vector<std::array<std::uint32_t, 3>> outsideOf(const TetBody& mesh)
{
    using Face = std::array<std::uint32_t, 3>;
    constexpr std::array<std::array<std::size_t, 3>, 4> faces{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};
    std::map<Face, int> uses;
    const auto sorted = [](Face face) {
        std::ranges::sort(face);
        return face;
    };
    const auto faceOf = [](const auto& tet, const auto& f) { return Face{tet[f[0]], tet[f[1]], tet[f[2]]}; };
    for (const auto& tet : mesh.tets) {
        for (const auto& f : faces) {
            ++uses[sorted(faceOf(tet, f))];
        }
    }
    std::vector<Face> out;
    for (const auto& tet : mesh.tets) {
        for (const auto& f : faces) {
            if (const Face face = faceOf(tet, f); uses[sorted(face)] == 1) {
                out.push_back(face);
            }
        }
    }
    return out;
}

void writeRivalPush(const std::filesystem::path& folder, const std::string& scene, const AccuracySubject& subject,
                    const TetBody& mesh)
{
    json push{{"palpate_push", fileFormat}, {"scene", scene}, {"density_kg_m3", density}};
    addPath(push, subject);
    addMesh(push, mesh);
    addMaterials(push, mesh);
    base::writeWhole(folder / "push.json", push.dump() + "\n");
}

RivalAnswer readRivalAnswer(const std::filesystem::path& folder, std::size_t looks, std::size_t points)
{
    constexpr std::size_t maxTimes = 10'000'000;
    RivalAnswer out;
    std::vector<Vec3> all;
    const auto displacements = folder / "displacements.csv";
    const std::size_t rows = readTable(displacements, "ux_m,uy_m,uz_m", looks * points,
                                       [&](std::span<const double> v) { all.emplace_back(v[0], v[1], v[2]); });
    checkRows(displacements, rows, looks * points, fmt::format("{} points at each of {} looks", points, looks));
    for (std::size_t look = 0; look < looks; ++look) {
        const auto first = all.begin() + static_cast<std::ptrdiff_t>(look * points);
        out.u.emplace_back(first, first + static_cast<std::ptrdiff_t>(points));
    }
    const auto forces = folder / "forces.csv";
    const std::size_t forceRows = readTable(forces, "fx_n,fy_n,fz_n", looks,
                                            [&](std::span<const double> v) { out.force.emplace_back(v[0], v[1], v[2]); });
    checkRows(forces, forceRows, looks, "one per look");
    const auto times = folder / "times.csv";
    readTable(times, "processor_s", maxTimes, [&](std::span<const double> v) {
        base::failIf(v[0] <= 0.0, "{}: {:g} s: must be over 0", times.filename().string(), v[0]);
        out.seconds.push_back(v[0]);
    });
    base::failIf(out.seconds.empty(), "{}: no rows: must be one per update in contact", times.filename().string());
    return out;
}

}  // namespace palpate::studies
