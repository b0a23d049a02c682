#include <reference/ccx.h>

#include <base/error.h>
#include <base/mapped.h>
#include <base/outputs.h>
#include <base/shell_word.h>
#include <base/units.h>
#include <reference/quadratic_mesh.h>

#include <fmt/format.h>
#include <fmt/ostream.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <sstream>

namespace palpate::reference {

namespace {

constexpr double newtonPerMilli = 1e-3;  // of a mN
constexpr double onPlane = 1e-9;         // m
constexpr std::size_t stepsPerCentre = 2;
// Sets of nodes that the patch drives along x, y, z.
constexpr std::array<const char*, 3> drivenSets{"DRIVENX", "DRIVENY", "DRIVENZ"};

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
        const Vec3 p = units::mm * quadratic.nodes[n];
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
        const double modulus = units::kPa * m.youngsModulus;
        fmt::print(out, "*MATERIAL, NAME=M{}\n", row);
        if (volume::isSmall(law)) {
            fmt::print(out, "*ELASTIC\n{:.12g},{:.12g}\n", modulus, m.poisson);
        } else {
            const double shear = modulus / (2.0 * (1.0 + m.poisson));
            const double bulk = modulus / (3.0 * (1.0 - 2.0 * m.poisson));
            fmt::print(out, "*HYPERELASTIC, NEO HOOKE\n{:.12g},{:.12g}\n", 0.5 * shear, 2.0 / bulk);
        }
        fmt::print(out, "*SOLID SECTION, ELSET=E{0}, MATERIAL=M{0}\n", row);
    }
}

using Block = std::vector<std::vector<double>>;

// Blocks of numbers that follow the headings of a kind in a .dat file.
std::vector<Block> blocksOf(const std::filesystem::path& file, const std::string& heading)
{
    std::ifstream in(file);
    std::vector<Block> blocks;
    bool inside = false;
    for (std::string line; std::getline(in, line);) {
        if (line.find_first_of("abcdefghijklmnopqrstuvwxyz") != std::string::npos) {
            inside = line.find(heading) != std::string::npos;
            if (inside) {
                blocks.emplace_back();
            }
            continue;
        }
        std::istringstream words(line);
        const std::vector<double> row{std::istream_iterator<double>(words), {}};
        if (inside && !row.empty()) {
            blocks.back().push_back(row);
        }
    }
    return blocks;
}

Block lastBlock(const std::filesystem::path& file, const std::string& heading)
{
    const std::vector<Block> blocks = blocksOf(file, heading);
    return blocks.empty() ? Block{} : blocks.back();
}

std::vector<Vec3> displacementsIn(const Block& block)
{
    return base::mapped<Vec3>(block, [&](const auto& row) { return Vec3(row.at(1), row.at(2), row.at(3)) / units::mm; });
}

// Runs ccx on an exported file, in its folder. Returns the file with its results.
std::filesystem::path resultsOf(const std::filesystem::path& file, int& status)
{
    const std::filesystem::path job = std::filesystem::absolute(file).replace_extension();
    const std::string command =
        fmt::format("cd {} && OMP_NUM_THREADS=1 ccx {} > ccx.log 2>&1", base::shellWord(job.parent_path().native()),
                    base::shellWord(job.filename().native()));
    std::filesystem::path results = job;
    results += ".dat";
    std::filesystem::remove(results);
    status = std::system(command.c_str());
    return results;
}

// Hexahedra of a shell whose outside is the part of a sphere that looks `ahead`, a unit vector, over the faces of a cube;
// their nodes follow the tissue's.
class ShellMesh {
public:
    ShellMesh(Vec3 centre, double radius, Vec3 ahead, std::size_t firstNode)
        : centre_(centre), radius_(radius), first_(firstNode)
    {
        constexpr double behind = -0.2;  // cosine: 100 degrees around
        for (int face = 0; face < 6; ++face) {
            for (int i = 0; i < across; ++i) {
                for (int j = 0; j < across; ++j) {
                    if (glm::dot(direction(face, i + 0.5, j + 0.5), ahead) > behind) {
                        addHexahedron(face, i, j);
                    }
                }
            }
        }
    }

    std::vector<Vec3> nodes;                            // [m]
    std::vector<std::array<std::size_t, 8>> hexahedra;  // in the order of C3D8, the outer face is S2

private:
    static constexpr int across = 14;  // per face of the cube: 1.1 mm on a sphere of 10 mm

    // In equal angles, so that the hexahedra are about equal.
    static Vec3 direction(int face, double i, double j)
    {
        const int axis = face / 2;
        const double side = face % 2 == 0 ? -1.0 : 1.0;
        const auto along = [](double k) { return std::tan((2.0 * k / across - 1.0) * std::atan(1.0)); };
        Vec3 p(0.0);
        p[axis] = side;
        p[(axis + 1) % 3] = side * along(i);  // so that the outside is counterclockwise on both faces
        p[(axis + 2) % 3] = along(j);
        return glm::normalize(p);
    }

    void addHexahedron(int face, int i, int j)
    {
        constexpr double inside = 0.8;
        const auto node = [&](int a, int b, double fraction) {
            return nodeAt(centre_ + fraction * radius_ * direction(face, i + a, j + b));
        };
        hexahedra.push_back({node(0, 0, inside), node(1, 0, inside), node(1, 1, inside), node(0, 1, inside),
                             node(0, 0, 1.0), node(1, 0, 1.0), node(1, 1, 1.0), node(0, 1, 1.0)});
    }

    std::size_t nodeAt(Vec3 p)
    {
        constexpr double same = 1e-7;  // [m]
        const auto key = [&](int c) { return std::llround(p[c] / same); };
        const auto [at, isNew] = found_.emplace(std::array{key(0), key(1), key(2)}, first_ + nodes.size());
        if (isNew) {
            nodes.push_back(p);
        }
        return at->second;
    }

    Vec3 centre_;    // [m]
    double radius_;  // [m]
    std::size_t first_;
    std::map<std::array<long long, 3>, std::size_t> found_;
};

void writeShell(std::ostream& out, const ShellMesh& shell, std::size_t firstNode, std::size_t firstElement)
{
    out << "*NODE, NSET=TOOL\n";
    for (std::size_t n = 0; n < shell.nodes.size(); ++n) {
        const Vec3 p = units::mm * shell.nodes[n];
        fmt::print(out, "{},{:.12g},{:.12g},{:.12g}\n", firstNode + n + 1, p.x, p.y, p.z);
    }
    out << "*ELEMENT, TYPE=C3D8, ELSET=ETOOL\n";
    for (std::size_t e = 0; e < shell.hexahedra.size(); ++e) {
        const auto& h = shell.hexahedra[e];
        fmt::print(out, "{},{},{},{},{},{},{},{},{}\n", firstElement + e + 1, h[0] + 1, h[1] + 1, h[2] + 1, h[3] + 1,
                   h[4] + 1, h[5] + 1, h[6] + 1, h[7] + 1);
    }
    // All of its nodes are driven, so that what it is made of does not matter.
    out << "*MATERIAL, NAME=MTOOL\n*ELASTIC\n1000.,0.3\n*SOLID SECTION, ELSET=ETOOL, MATERIAL=MTOOL\n"
        << "*SURFACE, NAME=BALL, TYPE=ELEMENT\nETOOL,S2\n";
}

// Faces of the tissue that the sphere may meet, by element and face of C3D10.
void writeMeetable(std::ostream& out, const TetMesh& mesh, const CcxPress& press)
{
    constexpr double reach = 8e-3;                         // beyond the sphere [m]
    constexpr std::array<int, 4> faceWithout{3, 4, 2, 1};  // by the corner that is not on it
    out << "*SURFACE, NAME=TISSUE, TYPE=ELEMENT\n";
    for (const TetMesh::Face& face : mesh.faces) {
        const Vec3 middle = (mesh.points[face.points[0]] + mesh.points[face.points[1]] + mesh.points[face.points[2]]) / 3.0;
        const auto near = [&](Vec3 centre) { return glm::distance(middle, centre) < press.radius + reach; };
        if (face.held || !std::ranges::any_of(press.centres, near)) {
            continue;
        }
        const auto& tet = mesh.tets[face.tet];
        for (std::size_t corner = 0; corner < 4; ++corner) {
            if (std::ranges::find(face.points, tet[corner]) == face.points.end()) {
                fmt::print(out, "{},S{}\n", face.tet + 1, faceWithout[corner]);
            }
        }
    }
}

// Two steps per centre: the sphere goes there, and rests. In an increment a place of the tissue keeps the face of the
// sphere that it touched at the beginning: without the rest, normals lag behind a sphere that goes sideways, as if it had
// friction.
void writeSteps(std::ostream& out, const CcxPress& press)
{
    constexpr std::array<const char*, stepsPerCentre> increments{"0.5,1.,1e-5,0.5", "1.,1."};
    for (std::size_t step = 0; step < stepsPerCentre * press.centres.size(); ++step) {
        const Vec3 way = units::mm * (press.centres[step / stepsPerCentre] - press.start);
        fmt::print(out, "*STEP, NLGEOM, INC=1000\n*STATIC\n{}\n*BOUNDARY\n", increments[step % stepsPerCentre]);
        for (int c = 0; c < 3; ++c) {
            fmt::print(out, "TOOL,{0},{0},{1:.12g}\n", c + 1, way[c]);
        }
        out << "*NODE PRINT, NSET=NALL, FREQUENCY=1000\nU\n*NODE PRINT, NSET=TOOL, FREQUENCY=1000, TOTALS=ONLY\nRF\n"
            << "*END STEP\n";
    }
}

// Points that are held, and the middles of edges between two of them.
std::set<std::uint32_t> heldNodes(std::span<const std::uint32_t> held, const QuadraticMesh& quadratic)
{
    const std::set<std::uint32_t> points(held.begin(), held.end());
    std::set<std::uint32_t> nodes = points;
    for (const auto& tet : quadratic.tets) {
        for (std::size_t e = 0; e < QuadraticMesh::edges.size(); ++e) {
            if (points.contains(tet[QuadraticMesh::edges[e][0]]) && points.contains(tet[QuadraticMesh::edges[e][1]])) {
                nodes.insert(tet[4 + e]);
            }
        }
    }
    return nodes;
}

}  // namespace

std::vector<Vec3> quadraticNodes(const TetMesh& mesh)
{
    return QuadraticMesh(mesh).nodes;
}

void checkCcx(const TetMesh& mesh, std::span<const Material> materials, Law law, const std::filesystem::path& file)
{
    for (const auto row : mesh.tissue) {
        base::failIf(!volume::isSmall(law) && materials[row].stiffening != 0.0,
                     "{}: CalculiX has no tissue that stiffens by {:g}: set it to 0", file.native(),
                     materials[row].stiffening);
    }
}

std::string ccxText(const TetMesh& mesh, std::span<const Material> materials, const SolveOptions& options,
                    const Patch& patch)
{
    QuadraticMesh quadratic(mesh);
    const Fixed fixed = fixedNodes(mesh, options, patch, quadratic);
    std::ostringstream out;
    writeElements(out, mesh, quadratic);
    writeMaterials(out, mesh, materials, options.law);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        fmt::print(out, "{}", fixed.driven[axis].empty() ? "" : fmt::format("*NSET, NSET={}\n", drivenSets[axis]));
        for (const std::uint32_t n : fixed.driven[axis]) {
            fmt::print(out, "{},\n", n + 1);
        }
    }
    out << (volume::isSmall(options.law) ? "*STEP\n*STATIC\n" : "*STEP, NLGEOM, INC=1000\n*STATIC\n0.2,1.,1e-3,0.2\n")
        << "*BOUNDARY\n";
    for (const auto& [where, u] : fixed.value) {
        fmt::print(out, "{},{},{},{:.12g}\n", where.first + 1, where.second + 1, where.second + 1, units::mm * u);
    }
    out << "*NODE PRINT, NSET=NALL, FREQUENCY=1000\nU\n";
    for (std::size_t axis = 0; axis < 3; ++axis) {
        if (!fixed.driven[axis].empty()) {
            fmt::print(out, "*NODE PRINT, NSET={}, FREQUENCY=1000, TOTALS=ONLY\nRF\n", drivenSets[axis]);
        }
    }
    out << "*END STEP\n";
    return out.str();
}

bool hasCcx()
{
    return std::system("command -v ccx > /dev/null 2>&1") == 0;
}

CcxSolution runCcx(const std::filesystem::path& file)
{
    int status = 0;
    const std::filesystem::path results = resultsOf(file, status);
    CcxSolution solution{displacementsIn(lastBlock(results, "displacements"))};
    base::failIf(status != 0 || solution.u.empty(), "{}: ccx gave no solution (exit status {})", file.native(), status);
    for (int axis = 0; axis < 3; ++axis) {
        const auto total = lastBlock(results, fmt::format("for set {}", drivenSets[static_cast<std::size_t>(axis)]));
        solution.force[axis] = total.empty() ? 0.0 : -newtonPerMilli * total.back().at(static_cast<std::size_t>(axis));
    }
    return solution;
}

void exportCcxPress(const TetMesh& mesh, std::span<const Material> materials, const CcxPress& press,
                    const std::filesystem::path& file)
{
    constexpr double pressurePer = 50.0;  // mm of overclosure, in the softest modulus
    checkCcx(mesh, materials, NeoHookean{}, file);
    const QuadraticMesh quadratic(mesh);
    const ShellMesh shell(press.start, press.radius, glm::normalize(press.centres.front() - press.start),
                          quadratic.nodes.size());
    std::ofstream out(file);
    writeElements(out, mesh, quadratic);
    writeMaterials(out, mesh, materials, NeoHookean{});
    writeShell(out, shell, quadratic.nodes.size(), mesh.tets.size());
    writeMeetable(out, mesh, press);
    const double softest = std::ranges::min_element(materials, {}, &Material::youngsModulus)->youngsModulus;
    fmt::print(out,
               "*SURFACE INTERACTION, NAME=TOUCH\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n{:.12g}\n"
               "*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE\nTISSUE,BALL\n*BOUNDARY\n",
               pressurePer * units::kPa * softest);
    for (const std::uint32_t n : heldNodes(press.held, quadratic)) {
        fmt::print(out, "{},1,3\n", n + 1);
    }
    writeSteps(out, press);
    out.close();
    base::failIf(!out, "{}: cannot be written", file.native());
}

std::vector<CcxSolution> runCcxPress(const std::filesystem::path& file, std::size_t steps)
{
    int status = 0;
    const std::filesystem::path results = resultsOf(file, status);
    const std::vector<Block> u = blocksOf(results, "displacements"), force = blocksOf(results, "for set TOOL");
    base::failIf(status != 0 || u.size() != stepsPerCentre * steps || force.size() != u.size(),
                 "{}: ccx solved {} of {} steps (exit status {}): ccx.log says why", file.native(),
                 std::min(u.size(), force.size()) / stepsPerCentre, steps, status);
    std::vector<CcxSolution> solutions;
    for (std::size_t i = stepsPerCentre - 1; i < u.size(); i += stepsPerCentre) {
        const auto& total = force[i].at(0);
        solutions.push_back({displacementsIn(u[i]), -newtonPerMilli * Vec3(total.at(0), total.at(1), total.at(2))});
    }
    return solutions;
}

}  // namespace palpate::reference
