#include <reference/box_mesh.h>
#include <reference/solve.h>
#include <studies/validate/experiment.h>

#include <gtest/gtest.h>

#include <cmath>

namespace palpate::reference {
namespace {

// A quarter of the upper half of a cylinder: a box whose squares become rings, planes of symmetry x, y, z = 0.
TetMesh quarterCylinder(const studies::Cylinder& shape, int cells)
{
    std::vector<double> across, up;
    for (int i = 0; i <= cells; ++i) {
        across.push_back(shape.radius * i / cells);
        up.push_back(0.5 * shape.height * i / cells);
    }
    TetMesh mesh = boxMesh(across, across, up, {});
    for (Vec3& p : mesh.points) {
        const double x = p.x / shape.radius, y = p.y / shape.radius;
        p.x *= std::sqrt(1.0 - 0.5 * y * y);
        p.y *= std::sqrt(1.0 - 0.5 * x * x);
    }
    return mesh;
}

// Load of a cylinder of shear modulus 1 kPa under strain [N].
double loadOf(const studies::Cylinder& shape, double stiffening, bool bonded, double strain, int cells)
{
    const TetMesh mesh = quarterCylinder(shape, cells);
    SolveOptions options;
    options.law = NeoHookean{};
    options.elements = Elements::p2p1;
    options.mirrored = {true, true, true};
    Solver solver(mesh, std::vector<Material>{{2e3 * (1.0 + shape.poisson), shape.poisson, stiffening}}, options);
    const double top = 0.5 * shape.height;
    Patch patch;
    patch.in = [top](Vec3 p) { return p.z > (1.0 - 1e-9) * top; };
    patch.u = [&](Vec3) { return Vec3(0.0, 0.0, -strain * top); };
    patch.components = {bonded, bonded, true};
    solver.prescribe(patch);
    return 4.0 * solver.force().z;
}

// The kernel's cells and quadratic tetrahedra share nothing. Bonded, stairs on the curved side of nearly incompressible
// cells make them stiffer: by 2 % at small strain and 6 % at 20 %, with cells of 1.9 mm.
TEST(CompressedCylinder, KernelAgreesWithTheReference)
{
    const studies::Cylinder shape;
    for (const double b : {0.0, -0.2}) {
        const auto smooth = studies::compressionLoads(shape, b, false, {0.2});
        const double exact = loadOf(shape, b, false, 0.2, 4);
        EXPECT_NEAR(1e3 * smooth[0], exact, 0.01 * exact) << b;
        const auto bonded = studies::compressionLoads(shape, b, true, {1e-3, 0.2});
        const double small = loadOf(shape, b, true, 1e-3, 6);
        EXPECT_NEAR(1e3 * bonded[0], small, 0.04 * small) << b;
        const double large = loadOf(shape, b, true, 0.2, 6);
        EXPECT_NEAR(1e3 * bonded[1], large, 0.08 * large) << b;
    }
}

}  // namespace
}  // namespace palpate::reference
