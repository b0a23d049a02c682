#include <reference/mesh_files.h>
#include <reference/press_path.h>
#include <reference/symmetry.h>
#include <tests/studies/small_block.h>

#include <gtest/gtest.h>
#include <vtkCellData.h>
#include <vtkDataArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLUnstructuredGridReader.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <set>
#include <stdexcept>

namespace palpate::reference {
namespace {

// The block under the 5 mm sphere, pressed 1 mm and not dragged, on a coarse mesh.
struct Pressed {
    haptics::SessionModel model = studies::smallBlock();
    studies::TrialPlace place = studies::trialPlace(*model.tissue, model.surface, model.approach.entry, model.approach.aim);
    studies::TrialPath path = shortPath();
    PressProblem problem{*model.tissue, model.surface, path, 20e-3, 0.45, {}};
    BodyMesh body = meshBody(*model.tissue, meshOptions(problem, 3e-3));
    std::string vtu;
    std::vector<Vec3> corners;  // displacements of the mesh's points at the last look
    studies::Reference reference = solvePath(
        problem, body, [&](const Solver& solver, std::size_t look, std::size_t looks, const studies::ReferenceState&) {
            if (look + 1 == looks) {
                vtu = vtuText(body.mesh, solver);
                corners = solver.displacement(body.mesh.points);
            }
        });

    studies::TrialPath shortPath() const
    {
        auto p = studies::trialPath(*model.tissue, model.surface, place, studies::trialTools()[0], 2e-3);
        p.press = p.gap + 1e-3;
        p.drag = 0.1e-3;
        return p;
    }
};

const Pressed& pressed()
{
    static const Pressed p;
    return p;
}

TEST(PressPath, LooksAtPointsOfALatticeInsideSoftTissue)
{
    const auto& p = pressed();
    const auto points = referencePoints(p.problem);
    ASSERT_GT(points.size(), 500U);
    for (const Vec3f& f : points) {
        const Vec3 at(f);
        EXPECT_LT(p.model.surface.distance(at), -0.4e-3);
        EXPECT_LT(at.y, 16e-3);
        const Vec3 steps = at / 2e-3;
        EXPECT_LT(glm::length(steps - glm::round(steps)), 1e-3);
    }
}

// The further in, the more force; it points out of the tissue; the base does not move; the front does.
TEST(PressPath, ForceGrowsWithDepth)
{
    const auto& p = pressed();
    ASSERT_GE(p.reference.states.size(), 4U);
    double before = -1.0;
    for (std::size_t look = 0; look < 4; ++look) {
        const auto& state = p.reference.states[look];
        ASSERT_EQ(state.u.size(), p.reference.position.size());
        EXPECT_GE(-state.force.y, before);
        before = -state.force.y;
    }
    EXPECT_GT(before, 1e-3);
    EXPECT_DOUBLE_EQ(
        p.reference.peakForce,
        glm::length(std::ranges::max(p.reference.states, {}, [](const auto& s) { return glm::length(s.force); }).force));
    const auto& last = p.reference.states[3];
    EXPECT_NEAR(last.largest, 0.8e-3, 0.35e-3);
    EXPECT_GT(last.strain, 0.02);
}

// A quarter of the block, on a mesh of its own, says of the whole what the whole says.
TEST(PressPath, AQuarterSpeaksForTheWhole)
{
    const auto& p = pressed();
    const volume::Tissue quarter = mirroredPart(*p.model.tissue, {true, false, true});
    EXPECT_EQ(4 * quarter.labels().values.size(), p.model.tissue->labels().values.size());
    PressProblem problem{quarter, p.model.surface, p.path, 20e-3, 0.45, {.mirrored = {true, false, true}}};
    problem.looks = {p.reference.states[3].pose};
    const auto reference = solvePath(problem, meshBody(quarter, meshOptions(problem, 2e-3)),
                                     [](const Solver&, std::size_t, std::size_t, const auto&) {});
    const auto& whole = p.reference.states[3];
    const auto& part = reference.states.back();
    EXPECT_EQ(reference.states.size(), 1U);
    EXPECT_EQ(part.force.x, 0.0);
    EXPECT_EQ(part.force.z, 0.0);
    EXPECT_NEAR(part.force.y, whole.force.y, 0.05 * glm::length(whole.force));
    EXPECT_NEAR(part.energy, whole.energy, 0.05 * whole.energy);
}

TEST(PressPath, RefusesAPlaneThatIsNone)
{
    EXPECT_THROW(mirroredPart(*pressed().model.tissue, {false, true, false}), std::runtime_error);
}

TEST(Vtu, HasTheDisplacementsOfTheSolution)
{
    const auto& p = pressed();
    vtkNew<vtkXMLUnstructuredGridReader> reader;
    reader->ReadFromInputStringOn();
    reader->SetInputString(p.vtu);
    reader->Update();
    auto* grid = reader->GetOutput();
    ASSERT_EQ(static_cast<std::size_t>(grid->GetNumberOfCells()), p.body.mesh.tets.size());
    auto* u = grid->GetPointData()->GetArray("displacement");
    ASSERT_NE(u, nullptr);
    for (std::size_t i = 0; i < p.corners.size(); ++i) {
        for (int c = 0; c < 3; ++c) {
            ASSERT_DOUBLE_EQ(u->GetComponent(static_cast<vtkIdType>(i), c), p.corners[i][c]);
        }
    }
    ASSERT_NE(grid->GetCellData()->GetArray("stress"), nullptr);
    EXPECT_EQ(grid->GetCellData()->GetArray("tissue")->GetComponent(0, 0), p.body.mesh.tissue[0]);
}

}  // namespace
}  // namespace palpate::reference
