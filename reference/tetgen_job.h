#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace palpate::reference {

/// What goes to the process that runs TetGen. Lengths in mm: TetGen's tolerances are made for numbers about 1.
struct TetGenJob {
    struct Region {
        std::array<double, 3> point{};  // inside it [mm]
        double number = 0;              // attribute of its tetrahedra, from 1
        double largest = 0;             // volume of a tetrahedron [mm^3]; 0: no bound
    };

    std::string switches;                              // of TetGen, as on its command line
    std::vector<std::array<double, 3>> points;         // [mm]
    std::vector<std::array<std::uint32_t, 3>> facets;  // points of each
    std::vector<Region> regions;
};

/// What comes back.
struct TetGenResult {
    std::string error;                                // why there is nothing else; empty: there is
    std::vector<std::array<double, 3>> points;        // those of the job first [mm]
    std::vector<std::array<std::uint32_t, 4>> tets;   // points of each; none after `-d`
    std::vector<std::int32_t> region;                 // TetGenJob::Region::number of each tetrahedron; others: no region's
    std::vector<std::array<std::uint32_t, 3>> faces;  // after `-d`: facets that cross others
};

/// Throw std::runtime_error when a file cannot be read or written.
void write(const std::filesystem::path& file, const TetGenJob& job);
void write(const std::filesystem::path& file, const TetGenResult& result);
TetGenJob readJob(const std::filesystem::path& file);
TetGenResult readResult(const std::filesystem::path& file);

}  // namespace palpate::reference
