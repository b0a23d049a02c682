#pragma once

#include <reference/solve.h>
#include <reference/tet_mesh.h>
#include <volume/tissue_table.h>

#include <filesystem>
#include <string>

namespace palpate::reference {

/// Endings of the files that a mesh can be written to, as in a message: ".vtu, .vtk, .msh or .inp".
std::string meshFileEndings();
/// Throws std::runtime_error for a name with another ending.
void checkMeshFile(const std::filesystem::path& file);

/// A mesh as the text of a file, by the ending of its name. Lengths are in metres in .vtu, .vtk and .msh, in mm in .inp,
/// whose stresses are in kPa.
///
///     .vtu, .vtk  VTK's unstructured grid; `tissue` of a cell is its row of the table, `tissue_names` the rows' names
///     .msh        gmsh 2.2: a physical volume per tissue, a physical surface per pair of tissues that touch
///     .inp        CalculiX and Abaqus: C3D4; per tissue ELSET T_NAME, NSET N_NAME, material, section; NSET OUTSIDE
///
/// Throws std::runtime_error as checkMeshFile().
std::string meshText(const TetMesh& mesh, const volume::TissueTable& table, const std::filesystem::path& file);

/// A solved state as a VTK unstructured grid (.vtu, XML) for ParaView: quadratic tetrahedra at rest, with `displacement`
/// [m] at their points, and `stress` (Cauchy, mean, [Pa]) and `tissue` (see BodyMesh) of each.
std::string vtuText(const TetMesh& mesh, const Solver& solver);

}  // namespace palpate::reference
