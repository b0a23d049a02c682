#include <reference/ccx.h>

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>

namespace palpate::reference {

namespace {

constexpr double perMetre = 1e3;    // mm
constexpr double perPascal = 1e-3;  // kPa
constexpr double newtonPer = 1e-3;  // of a mN
constexpr double onPlane = 1e-9;    // m
// Sets of nodes that the patch drives along x, y, z.
constexpr std::array<const char*, 3> drivenSets{"DRIVENX", "DRIVENY", "DRIVENZ"};

// Corners of each edge of C3D10, in its order.
constexpr std::array<std::array<std::size_t, 2>, 6> edges{{{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}}};

// Nodes by number: a corner's is its own, a middle's that of its edge.
class QuadraticMesh {
public:
    explicit QuadraticMesh(const TetMesh& mesh) : nodes(mesh.points)
    {
        for (const auto& tet : mesh.tets) {
            std::array<std::uint32_t, 10> ten{tet[0], tet[1], tet[2], tet[3]};
            for (std::size_t e = 0; e < edges.size(); ++e) {
                ten[4 + e] = middle(tet[edges[e][0]], tet[edges[e][1]]);
            }
            tets.push_back(ten);
        }
    }

    std::uint32_t middle(std::uint32_t a, std::uint32_t b)
    {
        const auto [at, isNew] = middles_.emplace(std::minmax(a, b), static_cast<std::uint32_t>(nodes.size()));
        if (isNew) {
            nodes.push_back(0.5 * (nodes[a] + nodes[b]));
        }
        return at->second;
    }
    std::array<std::uint32_t, 6> face(const TetMesh::Face& f)
    {
        const auto& p = f.points;
        return {p[0], p[1], p[2], middle(p[0], p[1]), middle(p[1], p[2]), middle(p[2], p[0])};
    }

    std::vector<Vec3> nodes;                          // [m]
    std::vector<std::array<std::uint32_t, 10>> tets;  // in the order of C3D10

private:
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles_;
};

// What each component of each node is set to.
struct Fixed {
    std::map<std::pair<std::uint32_t, int>, double> value;  // node and component to displacement [m]
    std::array<std::vector<std::uint32_t>, 3> driven;       // nodes of each component that the patch prescribes
};

bool mirroredAt(const SolveOptions& options, int axis, Vec3 p)
{
    return options.mirrored[static_cast<std::size_t>(axis)] && std::abs(p[axis]) < onPlane;
}

Fixed fixedNodes(const TetMesh& mesh, const SolveOptions& options, const Patch& patch, QuadraticMesh& quadratic)
{
    Fixed fixed;
    std::vector<char> inPatch(quadratic.nodes.size());
    for (const TetMesh::Face& face : mesh.faces) {
        const auto six = quadratic.face(face);
        const auto in = [&](std::uint32_t n) { return patch.in(quadratic.nodes[n]); };
        bool mirrored = false;
        for (int axis = 0; axis < 3; ++axis) {
            const auto on = [&](std::uint32_t n) { return mirroredAt(options, axis, quadratic.nodes[n]); };
            mirrored = mirrored || std::all_of(six.begin(), six.end(), on);
        }
        for (const std::uint32_t n : six) {
            for (int c = 0; c < 3 && face.held; ++c) {
                fixed.value[{n, c}] = 0.0;
            }
            inPatch[n] = inPatch[n] != 0 || (!face.held && !mirrored && std::all_of(six.begin(), six.end(), in)) ? 1 : 0;
        }
    }
    for (std::uint32_t n = 0; n < quadratic.nodes.size(); ++n) {
        for (int c = 0; c < 3; ++c) {
            if (mirroredAt(options, c, quadratic.nodes[n])) {
                fixed.value[{n, c}] = 0.0;
            }
            // Held nodes and planes of symmetry come first: this leaves them.
            const auto axis = static_cast<std::size_t>(c);
            if (inPatch[n] != 0 && patch.components[axis] &&
                fixed.value.emplace(std::pair(n, c), patch.u(quadratic.nodes[n])[c]).second) {
                fixed.driven[axis].push_back(n);
            }
        }
    }
    return fixed;
}

void writeElements(std::ostream& out, const TetMesh& mesh, const QuadraticMesh& quadratic)
{
    out << "*NODE, NSET=NALL\n";
    for (std::size_t n = 0; n < quadratic.nodes.size(); ++n) {
        const Vec3 p = perMetre * quadratic.nodes[n];
        fmt::print(out, "{},{:.12g},{:.12g},{:.12g}\n", n + 1, p.x, p.y, p.z);
    }
    for (int tissue = 0; tissue < 256; ++tissue) {
        if (std::find(mesh.tissue.begin(), mesh.tissue.end(), tissue) == mesh.tissue.end()) {
            continue;
        }
        fmt::print(out, "*ELEMENT, TYPE=C3D10, ELSET=E{}\n", tissue);
        for (std::size_t t = 0; t < quadratic.tets.size(); ++t) {
            if (mesh.tissue[t] == tissue) {
                const auto& n = quadratic.tets[t];
                fmt::print(out, "{},{},{},{},{},{},{},{},{},{},{}\n", t + 1, n[0] + 1, n[1] + 1, n[2] + 1, n[3] + 1,
                           n[4] + 1, n[5] + 1, n[6] + 1, n[7] + 1, n[8] + 1, n[9] + 1);
            }
        }
    }
}

void writeMaterials(std::ostream& out, const TetMesh& mesh, std::span<const Material> materials, Law law)
{
    for (std::size_t row = 0; row < materials.size(); ++row) {
        if (std::find(mesh.tissue.begin(), mesh.tissue.end(), row) == mesh.tissue.end()) {
            continue;
        }
        const Material& m = materials[row];
        const double modulus = perPascal * m.youngsModulus;
        fmt::print(out, "*MATERIAL, NAME=M{}\n", row);
        if (law == Law::linear) {
            fmt::print(out, "*ELASTIC\n{:.12g},{:.12g}\n", modulus, m.poisson);
        } else {
            const double shear = modulus / (2.0 * (1.0 + m.poisson));
            const double bulk = modulus / (3.0 * (1.0 - 2.0 * m.poisson));
            fmt::print(out, "*HYPERELASTIC, NEO HOOKE\n{:.12g},{:.12g}\n", 0.5 * shear, 2.0 / bulk);
        }
        fmt::print(out, "*SOLID SECTION, ELSET=E{0}, MATERIAL=M{0}\n", row);
    }
}

// Blocks of numbers that follow the last heading of its kind in a .dat file.
std::vector<std::vector<double>> lastBlock(const std::filesystem::path& file, const std::string& heading)
{
    std::ifstream in(file);
    std::vector<std::vector<double>> rows;
    bool inside = false;
    for (std::string line; std::getline(in, line);) {
        if (line.find_first_of("abcdefghijklmnopqrstuvwxyz") != std::string::npos) {
            inside = line.find(heading) != std::string::npos;
            if (inside) {
                rows.clear();
            }
            continue;
        }
        std::istringstream words(line);
        std::vector<double> row;
        for (double v = 0.0; words >> v;) {
            row.push_back(v);
        }
        if (inside && !row.empty()) {
            rows.push_back(std::move(row));
        }
    }
    return rows;
}

std::string quoted(const std::string& text)
{
    std::string out = "'";
    for (const char c : text) {
        out += c == '\'' ? std::string("'\\''") : std::string(1, c);
    }
    return out + "'";
}

}  // namespace

std::vector<Vec3> quadraticNodes(const TetMesh& mesh)
{
    return QuadraticMesh(mesh).nodes;
}

void exportCcx(const TetMesh& mesh, std::span<const Material> materials, const SolveOptions& options, const Patch& patch,
               const std::filesystem::path& file)
{
    for (const Material& m : materials) {
        if (options.law == Law::neoHookean && m.stiffening != 0.0) {
            throw std::runtime_error(
                fmt::format("{}: CalculiX has no tissue that stiffens by {:g}: set it to 0", file.string(), m.stiffening));
        }
    }
    QuadraticMesh quadratic(mesh);
    const Fixed fixed = fixedNodes(mesh, options, patch, quadratic);
    std::ofstream out(file);
    writeElements(out, mesh, quadratic);
    writeMaterials(out, mesh, materials, options.law);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        fmt::print(out, "{}", fixed.driven[axis].empty() ? "" : fmt::format("*NSET, NSET={}\n", drivenSets[axis]));
        for (const std::uint32_t n : fixed.driven[axis]) {
            fmt::print(out, "{},\n", n + 1);
        }
    }
    out << (options.law == Law::linear ? "*STEP\n*STATIC\n" : "*STEP, NLGEOM, INC=1000\n*STATIC\n0.2,1.,1e-3,0.2\n")
        << "*BOUNDARY\n";
    for (const auto& [where, u] : fixed.value) {
        fmt::print(out, "{},{},{},{:.12g}\n", where.first + 1, where.second + 1, where.second + 1, perMetre * u);
    }
    out << "*NODE PRINT, NSET=NALL, FREQUENCY=1000\nU\n";
    for (std::size_t axis = 0; axis < 3; ++axis) {
        if (!fixed.driven[axis].empty()) {
            fmt::print(out, "*NODE PRINT, NSET={}, FREQUENCY=1000, TOTALS=ONLY\nRF\n", drivenSets[axis]);
        }
    }
    out << "*END STEP\n";
    out.close();
    if (!out) {
        throw std::runtime_error(fmt::format("{}: cannot be written", file.string()));
    }
}

bool hasCcx()
{
    return std::system("command -v ccx > /dev/null 2>&1") == 0;
}

CcxSolution runCcx(const std::filesystem::path& file)
{
    const std::filesystem::path job = std::filesystem::absolute(file).replace_extension();
    const std::string command = fmt::format("cd {} && OMP_NUM_THREADS=1 ccx {} > /dev/null 2>&1",
                                            quoted(job.parent_path().string()), quoted(job.filename().string()));
    std::filesystem::path results = job;
    results += ".dat";
    std::filesystem::remove(results);
    const int status = std::system(command.c_str());
    const auto displacements = lastBlock(results, "displacements");
    if (status != 0 || displacements.empty()) {
        throw std::runtime_error(fmt::format("{}: ccx gave no solution (exit status {})", file.string(), status));
    }
    CcxSolution solution;
    for (const auto& row : displacements) {
        solution.u.push_back(Vec3(row.at(1), row.at(2), row.at(3)) / perMetre);
    }
    for (int axis = 0; axis < 3; ++axis) {
        const auto total = lastBlock(results, fmt::format("for set {}", drivenSets[static_cast<std::size_t>(axis)]));
        solution.force[axis] = total.empty() ? 0.0 : -newtonPer * total.back().at(static_cast<std::size_t>(axis));
    }
    return solution;
}

}  // namespace palpate::reference
