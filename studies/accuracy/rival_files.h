#pragma once

#include <studies/accuracy/accuracy.h>
#include <studies/kernel/baselines/tets.h>

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace palpate::studies {

/// An open file, as a stream of another program; number() is negative where it could not be opened.
class File {
public:
    /// @param flags  of open(2)
    File(const std::filesystem::path& path, int flags) : number_(::open(path.c_str(), flags | O_CLOEXEC, 0644)) {}
    ~File() { ::close(number_); }
    File& operator=(File&&) = delete;
    int number() const noexcept { return number_; }

private:
    int number_;
};

/// The last line of a program's log that is not empty, for a message: without control characters, its first 200. "" where
/// there is none.
std::string lastLine(const std::filesystem::path& log);

/// Triangles on the outside of tetrahedra, counterclockwise seen from outside, in the order of their tetrahedra.
/// @param mesh  whose tetrahedra have det(b - a, c - a, d - a) > 0
std::vector<std::array<std::uint32_t, 3>> outsideOf(const TetBody& mesh);

/// Writes `push.json` for a rival: mesh, materials, what is held, tool, its path tick by tick, looks. SI, patient frame
/// LPS. docs/accuracy.md has the keys.
/// @param folder  where it goes; must be there
/// @param scene   its name
/// Throws std::runtime_error when the file cannot be written.
void writeRivalPush(const std::filesystem::path& folder, const std::string& scene, const AccuracySubject& subject,
                    const TetBody& mesh);

/// What a rival found.
struct RivalAnswer {
    std::vector<std::vector<Vec3>> u;  // of the mesh's points at each look [m] (looks x points)
    std::vector<Vec3> force;           // on the tool at each look [N] (looks x 1)
    std::vector<double> seconds;       // processor time of updates in contact [s] (any number x 1)
};

/// Reads `displacements.csv`, `forces.csv` and `times.csv` of a rival.
/// @param looks   how many there are
/// @param points  of the mesh
/// Throws std::runtime_error ("FILE: what is wrong", on one line, the file without its folder) for a file that is missing,
/// has another head line, too few or too many rows, or numbers that are not finite or not there.
RivalAnswer readRivalAnswer(const std::filesystem::path& folder, std::size_t looks, std::size_t points);

}  // namespace palpate::studies
