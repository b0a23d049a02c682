#include <reference/tetgen/child.h>

#include <base/process.h>
#include <reference/tetgen_job.h>

#include <tetgen.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <new>
#include <string>

namespace palpate::reference {

namespace {

void fill(tetgenio& in, const TetGenJob& job)
{
    in.firstnumber = 0;
    in.numberofpoints = static_cast<int>(job.points.size());
    in.pointlist = new REAL[3 * job.points.size()];
    for (std::size_t p = 0; p < job.points.size(); ++p) {
        std::copy(job.points[p].begin(), job.points[p].end(), in.pointlist + 3 * p);
    }
    in.numberoffacets = static_cast<int>(job.facets.size());
    in.facetlist = new tetgenio::facet[job.facets.size()];
    in.facetmarkerlist = new int[job.facets.size()];
    for (std::size_t f = 0; f < job.facets.size(); ++f) {
        tetgenio::facet& facet = in.facetlist[f];
        tetgenio::init(&facet);
        facet.numberofpolygons = 1;
        facet.polygonlist = new tetgenio::polygon[1];
        tetgenio::init(facet.polygonlist);
        facet.polygonlist->numberofvertices = 3;
        facet.polygonlist->vertexlist = new int[3];
        std::copy(job.facets[f].begin(), job.facets[f].end(), facet.polygonlist->vertexlist);
        in.facetmarkerlist[f] = static_cast<int>(f) + 1;
    }
    in.numberofregions = static_cast<int>(job.regions.size());
    in.regionlist = new REAL[5 * job.regions.size()];
    for (std::size_t r = 0; r < job.regions.size(); ++r) {
        REAL* at = in.regionlist + 5 * r;
        std::copy(job.regions[r].point.begin(), job.regions[r].point.end(), at);
        at[3] = job.regions[r].number;
        at[4] = job.regions[r].largest > 0.0 ? job.regions[r].largest : -1.0;
    }
}

TetGenResult resultOf(const tetgenio& out, bool diagnosed)
{
    TetGenResult result;
    for (int p = 0; p < out.numberofpoints; ++p) {
        const REAL* at = out.pointlist + 3 * p;
        result.points.push_back({at[0], at[1], at[2]});
    }
    for (int t = 0; t < out.numberoftetrahedra; ++t) {
        const int* at = out.tetrahedronlist + t * out.numberofcorners;
        std::array<std::uint32_t, 4> tet{};
        std::copy(at, at + 4, tet.begin());
        result.tets.push_back(tet);
        const bool has = out.numberoftetrahedronattributes > 0;
        result.region.push_back(has ? static_cast<std::int32_t>(
                                          std::lround(out.tetrahedronattributelist[t * out.numberoftetrahedronattributes]))
                                    : 0);
    }
    for (int f = 0; diagnosed && f < out.numberoftrifaces; ++f) {
        std::array<std::uint32_t, 3> face{};
        std::copy(out.trifacelist + 3 * f, out.trifacelist + 3 * f + 3, face.begin());
        result.faces.push_back(face);
    }
    return result;
}

// What TetGen's numbers mean, as its command line says them.
const char* meaningOf(int error)
{
    switch (error) {
        case 1:
            return "memory ran out: take a larger size";
        case 3:
            return "surfaces cross each other";
        case 4:
            return "an edge is too short beside its surface";
        case 5:
            return "two surfaces are too near each other";
        case 10:
            return "surfaces are not what it can read";
        default:
            return "an error of its own";
    }
}

}  // namespace

int runTetGenJob(const std::filesystem::path& job, const std::filesystem::path& result)
{
    base::becomeQuietChild();
    std::string error;
    try {
        TetGenJob read = readJob(job);
        tetgenio in, out;
        fill(in, read);
        tetrahedralize(read.switches.data(), &in, &out);
        write(result, resultOf(out, read.switches.find('d') != std::string::npos));
        return 0;
    } catch (int number) {
        error = std::string(meaningOf(number)) + " (" + std::to_string(number) + ")";
    } catch (const std::bad_alloc&) {
        error = meaningOf(1);
    } catch (const std::exception& e) {
        error = e.what();
    }
    TetGenResult failed;
    failed.error = error;
    write(result, failed);
    return 1;
}

}  // namespace palpate::reference
