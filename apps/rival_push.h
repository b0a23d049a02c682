#pragma once

#include <volume/geometry.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace palpate::apps {

// What a rival of ours reads and writes, as docs/accuracy.md has it. SI, patient frame.

struct RivalMaterial {
    double youngsModulus = 0;  // [Pa]
    double poisson = 0;        // [-]
};

// push.json.
struct RivalPush {
    std::vector<Vec3> points;                             // at rest [m]
    std::vector<std::array<std::uint32_t, 4>> tets;       //
    std::vector<std::array<std::uint32_t, 3>> triangles;  // of the surface, counterclockwise seen from outside
    std::vector<std::uint32_t> held;                      // points
    std::vector<RivalMaterial> materials;
    std::vector<std::uint32_t> material;  // of each tetrahedron
    double density = 0;                   // [kg/m^3]
    double radius = 0;                    // of the sphere [m]
    double tick = 0;                      // [s]
    std::vector<Vec3> centre;             // of the sphere after each tick [m]
    std::vector<std::size_t> looks;       // ticks

    double tetVolume(std::size_t tet) const;  // [m^3]
};
// Throws std::runtime_error.
RivalPush readRivalPush(const std::filesystem::path& folder);

// displacements.csv, forces.csv and times.csv.
struct RivalResults {
    std::vector<std::vector<Vec3>> u;  // at each look, of each point [m]
    std::vector<Vec3> force;           // on the tool at each look [N]
    std::vector<double> seconds;       // of updates in contact [s]
};
// Throws std::runtime_error.
void writeRivalResults(const std::filesystem::path& folder, const RivalResults& results);

// main() of a rival: NAME [OPTIONS] FOLDER. Errors are one line, and the exit status is 1, or 2 for a wrong command line.
int rivalMain(int argc, char** argv, const std::string& name, const std::string& about,
              const std::function<RivalResults(const RivalPush&, const std::filesystem::path& folder)>& solve);

}  // namespace palpate::apps
