#include <reference/mesh_domain.h>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Labeled_mesh_domain_3.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_criteria_3.h>
#include <CGAL/Mesh_domain_with_polyline_features_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/exude_mesh_3.h>
#include <CGAL/make_mesh_3.h>
#include <CGAL/perturb_mesh_3.h>
#include <CGAL/refine_mesh_3.h>

#include <reference/sharp_edges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <unordered_map>

namespace palpate::reference {

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using LabelDomain = CGAL::Labeled_mesh_domain_3<Kernel>;
using Domain = CGAL::Mesh_domain_with_polyline_features_3<LabelDomain>;
using Triangulation = CGAL::Mesh_triangulation_3<Domain, CGAL::Default, CGAL::Sequential_tag>::type;
using Complex = CGAL::Mesh_complex_3_in_triangulation_3<Triangulation, Domain::Corner_index, Domain::Curve_index>;
using CellCriteria = CGAL::Mesh_cell_criteria_3<Triangulation>;

// Facets whose circumcircle is smaller than `least` are as they are: where tissues meet, the bound on their angles would
// put points ever nearer to each other.
class FacetCriteria : public CGAL::Mesh_facet_criteria_3<Triangulation> {
public:
    template <typename Size, typename Distance>
    FacetCriteria(double angle, const Size& size, const Distance& distance, double least)
        : Mesh_facet_criteria_3(angle, size, distance), least_(least)
    {
    }

    Is_facet_bad operator()(const Triangulation& triangulation, const Triangulation::Facet& facet) const
    {
        const auto at = [&](int i) {
            return facet.first->vertex(Triangulation::vertex_triple_index(facet.second, i))->point().point();
        };
        if (least_ > 0.0 && CGAL::squared_radius(at(0), at(1), at(2)) < least_ * least_) {
            return {};
        }
        return Mesh_facet_criteria_3::operator()(triangulation, facet);
    }

private:
    double least_;  // [mm]
};

using Criteria =
    CGAL::Mesh_criteria_3<Triangulation, CGAL::Mesh_edge_criteria_3<Triangulation>, FacetCriteria, CellCriteria>;

constexpr double inMillimetres = 1e3;  // CGAL's absolute tolerances are made for numbers about 1
constexpr double surfaceError = 1e-7;  // of a point on a surface, fraction of the box's radius
constexpr double facetAngle = 25.0;    // smallest of a facet [degrees]
constexpr double facetDistance =
    0.06;                             // of a facet's middle from the surface, fraction of the edge length: at the contact,
constexpr double maxDistance = 0.15;  // and anywhere
constexpr double minFacet = 0.1;      // circumradius of a facet that is refined, fraction of the shortest edge
constexpr double cellShape = 2.0;     // radius of a circumsphere by the shortest edge, at most
constexpr double cellRadius = 0.75;   // of a circumsphere, fraction of the edge length
constexpr double facetRadius = 0.65;  // of a facet's surface ball, fraction of the edge length
constexpr double sliver = 12.0;       // smaller dihedral angles are mended [degrees]
constexpr int rays = 20;              // from a seed
constexpr double golden = 2.399963229728653;  // angle between them [rad]

Point toPoint(Vec3 p)
{
    return {inMillimetres * p.x, inMillimetres * p.y, inMillimetres * p.z};
}

Vec3 toVec(const Point& p)
{
    return Vec3(p.x(), p.y(), p.z()) / inMillimetres;
}

double inRegion(const std::vector<double>& bounds, int subdomain)
{
    return subdomain > 0 ? bounds[static_cast<std::size_t>(subdomain - 1)] : 1.0;
}

// The smaller of the bounds on both sides of a surface [m].
double onPatch(const std::vector<double>& bounds, const Domain::Index& index)
{
    const auto patch = boost::get<Domain::Surface_patch_index>(index);
    return std::min(inRegion(bounds, patch.first), inRegion(bounds, patch.second));
}

// Edge length at a point [mm], times a share.
struct EdgeField {
    using FT = Kernel::FT;
    using Point_3 = Point;
    using Index = Domain::Index;

    const MeshOptions* options;
    const RegionBounds* bounds;
    double fraction;

    FT operator()(const Point_3& p, int dimension, const Index& index) const
    {
        if (dimension == 3 && options->inside > 0.0) {
            return fraction * inMillimetres * options->inside;
        }
        const double length = edgeLength(*options, toVec(p));
        return fraction * inMillimetres * (dimension == 2 ? std::min(length, onPatch(bounds->edge, index)) : length);
    }
};

// How far the middle of a facet may be from the surface [mm]: coarse ones, far away, may be further off for their size.
struct DistanceField {
    using FT = Kernel::FT;
    using Point_3 = Point;
    using Index = Domain::Index;

    const MeshOptions* options;
    const RegionBounds* bounds;

    FT operator()(const Point_3& p, int, const Index& index) const
    {
        const double length = edgeLength(*options, toVec(p));
        const double fraction = std::min(facetDistance * std::sqrt(length / options->size), maxDistance);
        return inMillimetres * std::min(fraction * length, onPatch(bounds->distance, index));
    }
};

CGAL::Bbox_3 boxAround(const SmoothLabels& labels)
{
    CGAL::Bbox_3 box;
    for (int c = 0; c < 8; ++c) {
        const Vec3 corner((c & 1) != 0 ? labels.size.x : -1, (c & 2) != 0 ? labels.size.y : -1,
                          (c & 4) != 0 ? labels.size.z : -1);
        box += toPoint(labels.affine.toPatient(Vec3(labels.low) + corner)).bbox();
    }
    return box;
}

// Points on the surface around every seed, so that no piece is overlooked.
void insertSeeds(const Domain& domain, std::span<const RegionSeed> seeds, double reach, Complex& complex)
{
    auto& triangulation = complex.triangulation();
    const auto intersect = domain.construct_intersection_object();
    for (const RegionSeed& seed : seeds) {
        for (int i = 0; i < rays; ++i) {
            const double z = 1.0 - (2.0 * i + 1.0) / rays, r = std::sqrt(1.0 - z * z), turn = golden * i;
            const Vec3 to = seed.point + reach * Vec3(r * std::cos(turn), r * std::sin(turn), z);
            const auto hit = intersect(Kernel::Segment_3(toPoint(seed.point), toPoint(to)));
            if (std::get<2>(hit) == 0) {
                continue;
            }
            const Triangulation::Weighted_point point(std::get<0>(hit));
            // A point in a ball that protects an edge would be hidden, or break it.
            const auto nearest = triangulation.nearest_power_vertex(std::get<0>(hit));
            const auto& ball = triangulation.point(nearest);
            if (CGAL::squared_distance(ball.point(), point.point()) <= 4.0 * ball.weight()) {
                continue;
            }
            const auto vertex = triangulation.insert(point);
            if (vertex != Triangulation::Vertex_handle()) {
                complex.set_dimension(vertex, 2);
                complex.set_index(vertex, std::get<1>(hit));
            }
        }
    }
}

TetMesh extract(const Complex& complex, const SmoothLabels& labels)
{
    TetMesh mesh;
    std::unordered_map<const void*, std::uint32_t> number;
    for (auto cell = complex.cells_in_complex_begin(); cell != complex.cells_in_complex_end(); ++cell) {
        std::array<std::uint32_t, 4> tet{};
        for (int i = 0; i < 4; ++i) {
            const auto vertex = cell->vertex(i);
            const auto [at, fresh] = number.try_emplace(&*vertex, static_cast<std::uint32_t>(mesh.points.size()));
            if (fresh) {
                mesh.points.push_back(toVec(vertex->point().point()));
            }
            tet[static_cast<std::size_t>(i)] = at->second;
        }
        mesh.tets.push_back(tet);
        mesh.tissue.push_back(labels.rows[static_cast<std::size_t>(complex.subdomain_index(cell) - 1)]);
    }
    return mesh;
}

Domain domainOf(const SmoothLabels& labels, double least, CGAL::Random& random)
{
    const std::function<int(const Point&)> label = [&labels](const Point& p) { return regionAt(labels, toVec(p)) + 1; };
    const auto box = boxAround(labels);
    const std::function<bool(int)> outside = [](int subdomain) { return subdomain == 0; };
    Domain domain(label, Kernel::Iso_cuboid_3(box), surfaceError, outside, &random);
    const Vec3 spacing = labels.affine.spacing();
    const double voxel = std::max({spacing.x, spacing.y, spacing.z});
    std::vector<std::vector<Point>> lines;
    for (const auto& line : sharpEdges(labels, least / inMillimetres / voxel)) {
        lines.emplace_back();
        std::ranges::transform(line, std::back_inserter(lines.back()), toPoint);
    }
    domain.add_features(lines.begin(), lines.end());
    return domain;
}

// Of a facet that is refined, and of a line [mm]; nothing where tetrahedra are wanted too.
double minOf(const MeshOptions& options, const RegionBounds& bounds)
{
    return options.surfacesOnly ? minFacet * inMillimetres * std::min(options.size, std::ranges::min(bounds.edge)) : 0.0;
}

Criteria criteriaOf(const MeshOptions& options, const RegionBounds& bounds)
{
    const auto fraction = [&](double s) { return EdgeField{&options, &bounds, s}; };
    return {CGAL::Mesh_edge_criteria_3<Triangulation>(fraction(1.0)),
            FacetCriteria(facetAngle, fraction(facetRadius), DistanceField{&options, &bounds}, minOf(options, bounds)),
            options.surfacesOnly ? CellCriteria(0.0, 0.0) : CellCriteria(cellShape, fraction(cellRadius))};
}

}  // namespace

std::optional<TetMesh> meshRegions(const SmoothLabels& labels, std::span<const RegionSeed> seeds,
                                   const MeshOptions& options, const RegionBounds& bounds, std::size_t maxPoints)
{
    namespace param = CGAL::parameters;
    CGAL::get_default_random() = CGAL::Random(1);
    CGAL::Random random(1);
    const Domain domain = domainOf(labels, minOf(options, bounds), random);
    const Criteria criteria = criteriaOf(options, bounds);
    Complex complex;
    CGAL::Mesh_3::internal::C3t3_initializer<Complex, Domain, Criteria, true>()(complex, domain, criteria, true);
    const auto box = domain.bbox();
    const double reach = std::hypot(box.xmax() - box.xmin(), box.ymax() - box.ymin(), box.zmax() - box.zmin());
    insertSeeds(domain, seeds, reach / inMillimetres, complex);
    CGAL::parameters::internal::Mesh_3_options stop;
    CGAL::Mesh_error_code stopped = CGAL::CGAL_MESH_3_NO_ERROR;
    stop.maximal_number_of_vertices = maxPoints;
    stop.pointer_to_error_code = &stopped;
    CGAL::refine_mesh_3(complex, domain, criteria, param::no_reset_c3t3(), param::no_perturb(), param::no_exude(), stop);
    if (stopped != CGAL::CGAL_MESH_3_NO_ERROR) {
        return std::nullopt;
    }
    if (options.surfacesOnly) {
        return extract(complex, labels);
    }
    CGAL::perturb_mesh_3(complex, domain, param::time_limit = 0, param::sliver_bound = sliver);
    CGAL::exude_mesh_3(complex, param::time_limit = 0, param::sliver_bound = sliver);
    return extract(complex, labels);
}

}  // namespace palpate::reference
