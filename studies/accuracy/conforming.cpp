#include <studies/accuracy/conforming.h>

#include <base/error.h>
#include <base/mapped.h>
#include <base/process.h>
#include <base/temporary_folder.h>
#include <studies/accuracy/rival_files.h>
#include <studies/kernel/baselines/factored.h>

#include <fmt/format.h>
#include <glm/common.hpp>

#include <algorithm>
#include <fstream>
#include <iomanip>
#include <limits>
#include <map>

namespace palpate::studies {

namespace fs = std::filesystem;

namespace {

constexpr double growth = 1.25;  // of edges away from surfaces: contact strains what is under it
constexpr int tetrahedron = 4;   // its type in a file of gmsh

void runMesher(const fs::path& mesher, const fs::path& volume, const fs::path& mesh, double size)
{
    const fs::path log = mesh.parent_path() / "log";
    const File said(log, O_WRONLY | O_CREAT);
    const int status = base::run({{mesher.string(), volume.string(), "-o", mesh.string(), "--size",
                                   fmt::format("{:g}", 1e3 * size), "--largest", fmt::format("{:g}", 1e3 * growth * size)},
                                  {-1, said.number(), said.number()}});
    if (status != 0) {
        throw base::error("palpate-mesh --size {:g}: {}", 1e3 * size, lastLine(log));
    }
}

// Points and tetrahedra of a .msh as palpate-mesh writes it, and the tissue of each.
class MeshFile {
public:
    MeshFile(const fs::path& file, const volume::TissueTable& table, double poissonCap)
        : in_(file), table_(table), poissonCap_(poissonCap)
    {
        for (std::string word; in_ >> word;) {
            if (word == "$PhysicalNames") {
                readNames();
            } else if (word == "$Nodes") {
                readPoints();
            } else if (word == "$Elements") {
                readTets();
            }
        }
        base::failIf(body_.tets.empty(), "{}: no tetrahedra; is palpate-mesh of another version?", file.native());
    }
    TetBody body() && { return std::move(body_); }

private:
    void readNames()
    {
        std::size_t count = 0;
        in_ >> count;
        std::string name;
        for (int dimension = 0, number = 0; count > 0 && in_ >> dimension >> number >> std::quoted(name); --count) {
            const auto row = std::ranges::find(table_.rows, name, &volume::TissueRow::name);
            if (dimension == 3 && row != table_.rows.end()) {
                tissues_[number] = &*row;
            }
        }
    }

    void readPoints()
    {
        std::size_t count = 0, number = 0;
        in_ >> count;
        Vec3 p;
        for (; count > 0 && in_ >> number >> p.x >> p.y >> p.z; --count) {
            body_.points.push_back(p);
        }
        body_.held.assign(body_.points.size(), 0);
    }

    void readTets()
    {
        std::size_t count = 0, number = 0;
        in_ >> count;
        for (int type = 0, tags = 0, tissue = 0, other = 0; count > 0 && in_ >> number >> type >> tags >> tissue >> other;
             --count) {
            std::array<std::uint32_t, 4> tet{};
            for (int i = 0; i < (type == tetrahedron ? 4 : 3); ++i) {
                in_ >> tet[static_cast<std::size_t>(i)];
                --tet[static_cast<std::size_t>(i)];
            }
            if (type == tetrahedron) {
                add(tet, *tissues_.at(tissue));
            }
        }
    }

    void add(const std::array<std::uint32_t, 4>& tet, const volume::TissueRow& row)
    {
        body_.add(tet, row.youngsModulus, std::min(row.poissonRatio, poissonCap_));
        for (const std::uint32_t p : tet) {
            body_.held.at(p) = row.fixed ? 1 : body_.held.at(p);
        }
    }

    std::ifstream in_;
    const volume::TissueTable& table_;
    double poissonCap_;
    std::map<int, const volume::TissueRow*> tissues_;
    TetBody body_;
};

// Box of all points [m].
std::pair<Vec3, Vec3> boxOf(const TetBody& body)
{
    Vec3 low(std::numeric_limits<double>::max()), high(-low);
    for (const Vec3 p : body.points) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    }
    return {low, high};
}

// A body that nothing holds lies on its back; what hangs on nothing that is held does not move.
void hold(TetBody& body)
{
    const auto [low, high] = boxOf(body);
    if (std::ranges::none_of(body.held, [](std::uint8_t h) { return h != 0; })) {
        const double back = high.y - onItsBack * (high.y - low.y);
        std::ranges::transform(body.points, body.held.begin(), [back](Vec3 p) { return p.y >= back ? 1 : 0; });
    }
    std::vector<std::uint8_t> reached = body.held;
    for (bool more = true; more;) {
        more = false;
        for (const auto& tet : body.tets) {
            const auto known = std::ranges::count_if(tet, [&](std::uint32_t p) { return reached[p] != 0; });
            if (known > 0 && known < 4) {
                more = true;
                std::ranges::for_each(tet, [&](std::uint32_t p) { reached[p] = 1; });
            }
        }
    }
    for (std::size_t p = 0; p < reached.size(); ++p) {
        body.held[p] = reached[p] != 0 ? body.held[p] : 1;
    }
}

// Cells of `spacing`, and which tetrahedra reach into each.
void addCells(TetBody& body, double spacing)
{
    const auto [low, high] = boxOf(body);
    body.corners = {Index3(glm::floor((high - low) / spacing)) + 2, low, spacing};
    std::vector<std::vector<std::uint32_t>> cells(body.corners.count());
    for (std::uint32_t t = 0; t < body.tets.size(); ++t) {
        Vec3 from(std::numeric_limits<double>::max()), to(-from);
        for (const std::uint32_t p : body.tets[t]) {
            from = glm::min(from, body.points[p]);
            to = glm::max(to, body.points[p]);
        }
        volume::forEachIndex(Index3(glm::floor((from - low) / spacing)), Index3(glm::floor((to - low) / spacing)),
                             [&](Index3 c) { cells[body.corners.offset(c)].push_back(t); });
    }
    for (const auto& tets : cells) {
        body.first.push_back(static_cast<std::uint32_t>(body.inCell.size()));
        body.inCell.insert(body.inCell.end(), tets.begin(), tets.end());
    }
    body.first.push_back(static_cast<std::uint32_t>(body.inCell.size()));
}

}  // namespace

TetBody conformingTets(const fs::path& mesher, const volume::Tissue& tissue, double size, double poissonCap,
                       std::size_t maxPoints)
{
    const base::TemporaryFolder folder("a mesh");
    const fs::path volume = folder / "volume.vdb", mesh = folder / "mesh.msh";
    tissue.save(volume);
    runMesher(mesher, volume, mesh, size);
    TetBody body = MeshFile(mesh, tissue.table(), poissonCap).body();
    base::failIf(body.points.size() > maxPoints, "{} points at {:g} mm: {} are the most; take a larger size",
                 body.points.size(), 1e3 * size, maxPoints);
    hold(body);
    body.outer.assign(body.points.size(), 0);
    for (const auto& face : outsideOf(body)) {
        std::ranges::for_each(face, [&](std::uint32_t p) { body.outer[p] = 1; });
    }
    addCells(body, size);
    return body;
}

std::vector<Baseline> conformingMethods(const AccuracySubject& subject, const fs::path& mesher)
{
    const double poissonCap = std::min(unlockedPoisson, subject.poissonCap());
    return base::mapped<Baseline>(std::initializer_list{8e-3, 6e-3}, [&](const double size) {
        const auto model = [&subject, mesher, size, poissonCap] {
            return factoredModel(conformingTets(mesher, *subject.model->tissue, size, poissonCap, FactoredTets::maxPoints),
                                 subject.path);
        };
        return Baseline{"tets_conforming", fmt::format("{:g} mm, Poisson {:g}", 1e3 * size, poissonCap), model};
    });
}

}  // namespace palpate::studies
