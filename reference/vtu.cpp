#include <reference/vtu.h>

#include <vtkCellData.h>
#include <vtkCellType.h>
#include <vtkDoubleArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLUnstructuredGridWriter.h>

#include <algorithm>
#include <map>
#include <utility>

namespace palpate::reference {

namespace {

// Edges in the order of VTK's quadratic tetrahedron, whose points they follow.
constexpr std::array<std::pair<std::size_t, std::size_t>, 6> edgeCorners{{{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}}};
// VTK stores xx yy zz xy yz xz, the solver xx yy zz yz xz xy.
constexpr std::array<std::size_t, 6> stressOrder{0, 1, 2, 5, 3, 4};

struct QuadraticMesh {
    std::vector<Vec3> points;  // corners, then middles of edges [m]
    std::vector<std::array<vtkIdType, 10>> cells;
};

QuadraticMesh quadratic(const TetMesh& mesh)
{
    QuadraticMesh out;
    out.points = mesh.points;
    std::map<std::pair<std::uint32_t, std::uint32_t>, vtkIdType> middle;
    for (const auto& tet : mesh.tets) {
        std::array<vtkIdType, 10> cell{};
        std::copy(tet.begin(), tet.end(), cell.begin());
        for (std::size_t e = 0; e < edgeCorners.size(); ++e) {
            const auto [a, b] = std::minmax(tet[edgeCorners[e].first], tet[edgeCorners[e].second]);
            const auto [at, fresh] = middle.try_emplace({a, b}, static_cast<vtkIdType>(out.points.size()));
            if (fresh) {
                out.points.push_back(0.5 * (mesh.points[a] + mesh.points[b]));
            }
            cell[4 + e] = at->second;
        }
        out.cells.push_back(cell);
    }
    return out;
}

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

std::string vtuText(const TetMesh& mesh, const Solver& solver)
{
    const QuadraticMesh q = quadratic(mesh);
    vtkNew<vtkPoints> points;
    points->SetDataTypeToDouble();
    for (const Vec3 p : q.points) {
        points->InsertNextPoint(p.x, p.y, p.z);
    }
    vtkNew<vtkUnstructuredGrid> grid;
    grid->SetPoints(points);
    grid->Allocate(static_cast<vtkIdType>(q.cells.size()));
    vtkNew<vtkUnsignedCharArray> tissue;
    tissue->SetName("tissue");
    for (std::size_t t = 0; t < q.cells.size(); ++t) {
        grid->InsertNextCell(VTK_QUADRATIC_TETRA, 10, q.cells[t].data());
        tissue->InsertNextValue(mesh.tissue[t]);
    }
    grid->GetPointData()->SetVectors(displacementOf(solver.displacement(q.points)));
    grid->GetCellData()->AddArray(stressOf(solver));
    grid->GetCellData()->AddArray(tissue);
    vtkNew<vtkXMLUnstructuredGridWriter> writer;
    writer->SetInputData(grid);
    writer->WriteToOutputStringOn();
    writer->Write();
    return writer->GetOutputString();
}

}  // namespace palpate::reference
