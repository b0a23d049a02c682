#include <reference/mesh_files.h>

#include <base/error.h>
#include <base/units.h>
#include <reference/quadratic_mesh.h>
#include <reference/surfaces.h>

#include <fmt/format.h>
#include <vtkCellData.h>
#include <vtkCellType.h>
#include <vtkDoubleArray.h>
#include <vtkFieldData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkStringArray.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>
#include <vtkUnstructuredGridWriter.h>
#include <vtkXMLUnstructuredGridWriter.h>

#include <algorithm>
#include <cctype>
#include <iterator>
#include <map>
#include <set>
#include <utility>

namespace palpate::reference {

namespace {

constexpr std::size_t perLine = 12;  // numbers of a node set

using Text = std::back_insert_iterator<std::string>;

// Puts nodes and tetrahedra into a grid: of VTK_TETRA or VTK_QUADRATIC_TETRA. Returns the tissue of each.
template <std::size_t count>
vtkNew<vtkUnsignedCharArray> addTets(const std::vector<Vec3>& nodes,
                                     const std::vector<std::array<std::uint32_t, count>>& tets,
                                     const std::vector<std::uint8_t>& tissues, int type, vtkUnstructuredGrid& grid)
{
    vtkNew<vtkPoints> points;
    points->SetDataTypeToDouble();
    for (const Vec3 p : nodes) {
        points->InsertNextPoint(p.x, p.y, p.z);
    }
    grid.SetPoints(points);
    grid.Allocate(static_cast<vtkIdType>(tets.size()));
    vtkNew<vtkUnsignedCharArray> tissue;
    tissue->SetName("tissue");
    for (std::size_t t = 0; t < tets.size(); ++t) {
        std::array<vtkIdType, count> cell{};
        std::ranges::copy(tets[t], cell.begin());
        grid.InsertNextCell(type, count, cell.data());
        tissue->InsertNextValue(tissues[t]);
    }
    return tissue;
}

void fillGrid(const TetMesh& mesh, const volume::TissueTable& table, vtkUnstructuredGrid& grid)
{
    grid.GetCellData()->SetScalars(addTets(mesh.points, mesh.tets, mesh.tissue, VTK_TETRA, grid));
    vtkNew<vtkStringArray> names;
    names->SetName("tissue_names");
    for (const auto& row : table.rows) {
        names->InsertNextValue(row.name);
    }
    grid.GetFieldData()->AddArray(names);
}

std::string xmlText(vtkUnstructuredGrid& grid)
{
    vtkNew<vtkXMLUnstructuredGridWriter> writer;
    writer->SetInputData(&grid);
    writer->WriteToOutputStringOn();
    writer->Write();
    return writer->GetOutputString();
}

std::string vtuText(const TetMesh& mesh, const volume::TissueTable& table)
{
    vtkNew<vtkUnstructuredGrid> grid;
    fillGrid(mesh, table, *grid);
    return xmlText(*grid);
}

std::string vtkText(const TetMesh& mesh, const volume::TissueTable& table)
{
    vtkNew<vtkUnstructuredGrid> grid;
    fillGrid(mesh, table, *grid);
    vtkNew<vtkUnstructuredGridWriter> writer;
    writer->SetInputData(grid);
    writer->SetFileTypeToBinary();
    writer->SetFileVersion(vtkUnstructuredGridWriter::VTK_LEGACY_READER_VERSION_4_2);  // which others read too
    writer->WriteToOutputStringOn();
    writer->Write();
    return writer->GetOutputStdString();
}

std::set<std::uint8_t> tissuesOf(const TetMesh& mesh)
{
    return {mesh.tissue.begin(), mesh.tissue.end()};
}

// Facets by the pair of tissues that they lie between, each with a number after those of the tissues.
std::map<std::pair<std::uint8_t, std::uint8_t>, std::size_t> pairsOf(const Surfaces& surfaces, std::size_t first)
{
    std::map<std::pair<std::uint8_t, std::uint8_t>, std::size_t> pairs;
    for (const auto& f : surfaces.facets) {
        pairs[std::minmax(f.front, f.back)] = 0;
    }
    for (auto& [pair, number] : pairs) {
        number = first++;
    }
    return pairs;
}

// Source: C. Geuzaine, J.-F. Remacle, "Gmsh Reference Manual", MSH file format version 2.
std::string mshText(const TetMesh& mesh, const volume::TissueTable& table)
{
    const Surfaces surfaces = surfacesOf(mesh, AllPoints::yes);
    const auto tissues = tissuesOf(mesh);
    const auto pairs = pairsOf(surfaces, table.rows.size());
    std::string text;
    const Text out(text);
    fmt::format_to(out, "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n{}\n", tissues.size() + pairs.size());
    const auto name = [&](std::uint8_t row) { return row == Surfaces::outside ? "outside" : table.rows[row].name; };
    for (const auto& [pair, number] : pairs) {
        fmt::format_to(out, "2 {} \"{}|{}\"\n", number, name(pair.first), name(pair.second));
    }
    for (const std::uint8_t row : tissues) {
        fmt::format_to(out, "3 {} \"{}\"\n", row, table.rows[row].name);
    }
    fmt::format_to(out, "$EndPhysicalNames\n$Nodes\n{}\n", mesh.points.size());
    for (std::size_t p = 0; p < mesh.points.size(); ++p) {
        fmt::format_to(out, "{} {:.17g} {:.17g} {:.17g}\n", p + 1, mesh.points[p].x, mesh.points[p].y, mesh.points[p].z);
    }
    fmt::format_to(out, "$EndNodes\n$Elements\n{}\n", surfaces.facets.size() + mesh.tets.size());
    std::size_t element = 1;
    for (const auto& f : surfaces.facets) {
        const std::size_t number = pairs.at(std::minmax(f.front, f.back));
        fmt::format_to(out, "{} 2 2 {} {} {} {} {}\n", element++, number, number, f.points[0] + 1, f.points[1] + 1,
                       f.points[2] + 1);
    }
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const auto& n = mesh.tets[t];
        const int row = mesh.tissue[t];
        fmt::format_to(out, "{} 4 2 {} {} {} {} {} {}\n", element++, row, row, n[0] + 1, n[1] + 1, n[2] + 1, n[3] + 1);
    }
    text += "$EndElements\n";
    return text;
}

// A tissue's name as CalculiX takes one: capitals, digits and underscores, from a letter on.
std::string setName(const std::string& name)
{
    std::string out = "T_";
    for (const char c : name) {
        const auto byte = static_cast<unsigned char>(c);
        out += std::isalnum(byte) != 0 ? static_cast<char>(std::toupper(byte)) : '_';
    }
    return out;
}

// Of each row of the table. Names that would be alike have their row at the end, but for the first.
std::vector<std::string> setNames(const volume::TissueTable& table)
{
    std::vector<std::string> names;
    for (const auto& row : table.rows) {
        std::string name = setName(row.name);
        while (std::ranges::find(names, name) != names.end()) {
            name += fmt::format("_{}", names.size());
        }
        names.push_back(name);
    }
    return names;
}

void addNodeSet(const std::string& name, const std::set<std::uint32_t>& nodes, std::string& text)
{
    text += "*NSET, NSET=" + name + "\n";
    std::size_t at = 0;
    for (const std::uint32_t n : nodes) {
        fmt::format_to(Text(text), "{},{}", n + 1, ++at % perLine == 0 ? "\n" : "");
    }
    text += at % perLine == 0 ? "" : "\n";
}

void addNodeSets(const TetMesh& mesh, const std::vector<std::string>& names, std::string& text)
{
    std::set<std::uint32_t> outside;
    for (const auto& f : surfacesOf(mesh, AllPoints::yes).facets) {
        if (f.front == Surfaces::outside) {
            outside.insert(f.points.begin(), f.points.end());
        }
    }
    addNodeSet("OUTSIDE", outside, text);
    std::map<std::uint8_t, std::set<std::uint32_t>> nodes;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        nodes[mesh.tissue[t]].insert(mesh.tets[t].begin(), mesh.tets[t].end());
    }
    for (const auto& [row, set] : nodes) {
        addNodeSet("N" + names[row].substr(1), set, text);
    }
}

// Source: G. Dhondt, "CalculiX CrunchiX User's Manual", version 2.20.
std::string inpText(const TetMesh& mesh, const volume::TissueTable& table)
{
    std::string text =
        "** mm, kPa, mN; small strain: put *HYPERELASTIC in place of *ELASTIC and NLGEOM to *STEP for more\n"
        "*NODE, NSET=NALL\n";
    const Text out(text);
    for (std::size_t p = 0; p < mesh.points.size(); ++p) {
        const Vec3 at = units::mm * mesh.points[p];
        fmt::format_to(out, "{},{:.12g},{:.12g},{:.12g}\n", p + 1, at.x, at.y, at.z);
    }
    const std::vector<std::string> names = setNames(table);
    for (const std::uint8_t row : tissuesOf(mesh)) {
        fmt::format_to(out, "*ELEMENT, TYPE=C3D4, ELSET={}\n", names[row]);
        for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
            const auto& n = mesh.tets[t];
            if (mesh.tissue[t] == row) {
                fmt::format_to(out, "{},{},{},{},{}\n", t + 1, n[0] + 1, n[1] + 1, n[2] + 1, n[3] + 1);
            }
        }
    }
    for (const std::uint8_t row : tissuesOf(mesh)) {
        const auto& tissue = table.rows[row];
        fmt::format_to(out, "*MATERIAL, NAME={0}\n*ELASTIC\n{1:.12g},{2:.12g}\n*SOLID SECTION, ELSET={0}, MATERIAL={0}\n",
                       names[row], units::kPa * tissue.youngsModulus, tissue.poissonRatio);
    }
    addNodeSets(mesh, names, text);
    return text;
}

using Maker = std::string (*)(const TetMesh&, const volume::TissueTable&);

Maker makerOf(const std::filesystem::path& file)
{
    static const std::map<std::string, Maker> makers{
        {".vtu", vtuText}, {".vtk", vtkText}, {".msh", mshText}, {".inp", inpText}};
    const auto found = makers.find(file.extension().string());
    base::failIf(found == makers.end(), "{}: a mesh is written as {}: name it so", file.native(), meshFileEndings());
    return found->second;
}

// VTK stores xx yy zz xy yz xz, the solver xx yy zz yz xz xy.
constexpr std::array<std::size_t, 6> stressOrder{0, 1, 2, 5, 3, 4};

vtkNew<vtkDoubleArray> displacementOf(const std::vector<Vec3>& u)
{
    vtkNew<vtkDoubleArray> out;
    out->SetName("displacement");
    out->SetNumberOfComponents(3);
    for (const Vec3 v : u) {
        out->InsertNextTuple3(v.x, v.y, v.z);
    }
    return out;
}

vtkNew<vtkDoubleArray> stressOf(const Solver& solver)
{
    vtkNew<vtkDoubleArray> out;
    out->SetName("stress");
    out->SetNumberOfComponents(6);
    for (const auto& s : solver.stress()) {
        std::array<double, 6> ordered{};
        std::ranges::transform(stressOrder, ordered.begin(), [&](std::size_t i) { return s[i]; });
        out->InsertNextTuple(ordered.data());
    }
    return out;
}

}  // namespace

std::string meshFileEndings()
{
    return ".vtu, .vtk, .msh or .inp";
}

void checkMeshFile(const std::filesystem::path& file)
{
    makerOf(file);
}

std::string meshText(const TetMesh& mesh, const volume::TissueTable& table, const std::filesystem::path& file)
{
    return makerOf(file)(mesh, table);
}

std::string vtuText(const TetMesh& mesh, const Solver& solver)
{
    const QuadraticMesh q(mesh);
    vtkNew<vtkUnstructuredGrid> grid;
    const auto tissue = addTets(q.nodes, q.tets, mesh.tissue, VTK_QUADRATIC_TETRA, *grid);
    grid->GetPointData()->SetVectors(displacementOf(solver.displacement(q.nodes)));
    grid->GetCellData()->AddArray(stressOf(solver));
    grid->GetCellData()->AddArray(tissue);
    return xmlText(*grid);
}

}  // namespace palpate::reference
