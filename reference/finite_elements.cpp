#include <base/error.h>
#include <base/units.h>
#include <reference/finite_elements.h>

#include <getfem/getfem_generic_assembly.h>
#include <getfem/getfem_interpolation.h>
#include <getfem/getfem_mesh_fem.h>
#include <getfem/getfem_mesh_im.h>
#include <gmm/gmm_iter_solvers.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::reference {

namespace {

using Matrix = getfem::model_real_sparse_matrix;
using getfem::size_type;

// The contact's r in moduli per face's edge: without multipliers a pressure of half a modulus would sink a 200th of an edge
// in, and each update of theirs takes that down some eighty times.
constexpr double contactStiffness = 100.0;
constexpr double maxStretch = 30.0;  // of a face's area, that r grows by
constexpr double onItsPlane = 1e-9;  // m
constexpr double reach = 0.25;       // faces this many radii away are looked at
constexpr int facesRule = 8;         // degree of quadrature on faces: contact ends within one

Vec3 at(const std::vector<double>& state, std::size_t node)
{
    return {state[3 * node], state[3 * node + 1], state[3 * node + 2]};
}

// With Q from the nearest point of the tool's middle line to where a point is.
constexpr const char* contactEnergyText = "half_sqr_pos_part(lambda-r*(Norm(Q)-R))/r";
// Its second derivative, but for the pressure in the tool's curvature where it is over twice the multiplier: a guess may
// lie far inside the tool and have a pressure there that is out of all proportion, and would make the tissue lose its
// stiffness. The multiplier is about what the pressure comes to. Along its shaft the tool does not curve.
constexpr const char* contactTangentText =
    "Heaviside(lambda-r*(Norm(Q)-R))*((r+C)*(N.Test_u)*(N.Test2_u)"
    "-C*(Test_u.Test2_u-Heaviside(T)*Heaviside(1-T)*(a.Test_u)*(S.Test2_u)))";
constexpr const char* contactPressureText = "pos_part(lambda-r*(Norm(Q)-R))*Test_v";

}  // namespace

struct FiniteElements::Impl {
    explicit Impl(const SolveOptions& o)
        : options(o), uField(mesh, 3), pField(mesh), cellField(mesh), vertexField(mesh), volumeRule(mesh), faceRule(mesh)
    {
    }

    void addMesh(const TetMesh& from);
    void addMaterials(const TetMesh& from, std::span<const Material> materials);
    void findFaces(const TetMesh& from);

    bool mixed() const { return options.elements == Elements::p2p1; }
    gmm::sub_interval uPart() const { return {0, uField.nb_dof()}; }
    gmm::sub_interval pPart() const { return {uField.nb_dof(), mixed() ? pField.nb_dof() : 0}; }
    std::size_t size() const { return uField.nb_dof() + pPart().size(); }

    // GetFEM reads the state through these, so that a workspace may be made for any.
    struct Fields {
        std::vector<double> u, p;
    };
    Fields split(const std::vector<double>& state) const
    {
        const auto middle = state.begin() + static_cast<std::ptrdiff_t>(uField.nb_dof());
        return {{state.begin(), middle}, {middle, state.end()}};
    }
    // As variables, to derive by, or as given.
    enum class As : std::uint8_t { variable, given };
    void addState(getfem::ga_workspace& space, const Fields& fields, As as) const;
    void addTissue(getfem::ga_workspace& space, const Fields& fields, As as = As::variable) const;
    void addContact(getfem::ga_workspace& space, const Fields& fields, As as = As::variable) const;
    const Matrix& linearTissue();

    SolveOptions options;
    getfem::mesh mesh;
    getfem::mesh_fem uField, pField, cellField, vertexField;
    getfem::mesh_im volumeRule, faceRule;
    std::vector<double> mu, bulk, stiffening;  // of each tetrahedron
    std::vector<double> restR, contactR;       // of each, at rest and now
    bool stiffens = false;
    Matrix linear;  // second derivative of the tissue's energy, with small strain

    struct Face {
        size_type tet;
        getfem::short_type side;
    };
    std::vector<Face> faces;
    std::vector<char> freeFaces;
    std::vector<std::array<std::uint32_t, 6>> faceNodes;
    std::vector<Vec3> nodes;

    Obstacle obstacle;
    std::vector<double> centre = std::vector<double>(3), radius = std::vector<double>(1);
    std::vector<double> shaft = std::vector<double>(3), alongShaft = std::vector<double>(3);
    std::vector<double> multipliers;  // (vertex x 1) [kPa]
    getfem::mesh_region touching;
};

void FiniteElements::Impl::addMesh(const TetMesh& from)
{
    for (const Vec3& p : from.points) {
        mesh.add_point(bgeot::base_node(units::mm * p.x, units::mm * p.y, units::mm * p.z), 0.0, false);
    }
    for (const auto& tet : from.tets) {
        mesh.add_simplex(3, tet.begin());
    }
    uField.set_classical_finite_element(2);
    pField.set_classical_finite_element(1);
    vertexField.set_classical_finite_element(1);
    cellField.set_classical_discontinuous_finite_element(0);
    volumeRule.set_integration_method(bgeot::dim_type(2));
    faceRule.set_integration_method(bgeot::dim_type(facesRule));
    nodes.resize(uField.nb_basic_dof() / 3);
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        const bgeot::base_node p = uField.point_of_basic_dof(3 * n);
        nodes[n] = {p[0], p[1], p[2]};
    }
    multipliers.assign(vertexField.nb_dof(), 0.0);
}

void FiniteElements::Impl::findFaces(const TetMesh& from)
{
    for (const TetMesh::Face& face : from.faces) {
        for (getfem::short_type side = 0; side < 4; ++side) {
            const auto points = mesh.ind_points_of_face_of_convex(face.tet, side);
            if (std::is_permutation(points.begin(), points.end(), face.points.begin(), face.points.end())) {
                faces.push_back({face.tet, side});
                const auto dofs = uField.ind_basic_dof_of_face_of_element(face.tet, side);
                std::array<std::uint32_t, 6> six{};
                for (std::size_t k = 0; k < six.size(); ++k) {
                    six[k] = static_cast<std::uint32_t>(dofs[3 * k] / 3);
                }
                faceNodes.push_back(six);
            }
        }
        bool mirrored = false;
        for (int axis = 0; axis < 3; ++axis) {
            mirrored = mirrored || (options.mirrored[static_cast<std::size_t>(axis)] &&
                                    std::all_of(face.points.begin(), face.points.end(), [&](std::uint32_t p) {
                                        return std::abs(from.points[p][axis]) < onItsPlane;
                                    }));
        }
        freeFaces.push_back(!face.held && !mirrored ? 1 : 0);
    }
    base::failIf(faces.size() != from.faces.size(),
                 "mesh: a face is not one of its tetrahedron's: give each face's tetrahedron");
}

void FiniteElements::Impl::addMaterials(const TetMesh& from, std::span<const Material> materials)
{
    for (auto* field : {&mu, &bulk, &stiffening, &contactR}) {
        field->resize(cellField.nb_dof());
    }
    for (std::size_t t = 0; t < from.tets.size(); ++t) {
        const std::size_t cell = cellField.ind_basic_dof_of_element(t)[0];
        const Material& m = materials[from.tissue[t]];
        const double modulus = units::kPa * m.youngsModulus;
        mu[cell] = modulus / (2.0 * (1.0 + m.poisson));
        bulk[cell] = modulus / (3.0 * (1.0 - 2.0 * m.poisson));
        stiffening[cell] = m.stiffening;
        stiffens = stiffens || m.stiffening != 0.0;
        contactR[cell] = contactStiffness * modulus;
    }
    for (const Face& face : faces) {
        const auto p = mesh.points_of_face_of_convex(face.tet, face.side);
        const double edge = (gmm::vect_dist2(p[0], p[1]) + gmm::vect_dist2(p[1], p[2]) + gmm::vect_dist2(p[2], p[0])) / 3.0;
        const std::size_t cell = cellField.ind_basic_dof_of_element(face.tet)[0];
        contactR[cell] = contactStiffness * units::kPa * materials[from.tissue[face.tet]].youngsModulus / edge;
    }
    restR = contactR;
}

void FiniteElements::Impl::addState(getfem::ga_workspace& space, const Fields& fields, As as) const
{
    if (as == As::variable) {
        space.add_fem_variable("u", uField, uPart(), fields.u);
    } else {
        space.add_fem_constant("u", uField, fields.u);
    }
    if (mixed() && as == As::variable) {
        space.add_fem_variable("p", pField, pPart(), fields.p);
    } else if (mixed()) {
        space.add_fem_constant("p", pField, fields.p);
    }
}

void FiniteElements::Impl::addTissue(getfem::ga_workspace& space, const Fields& fields, As as) const
{
    addState(space, fields, as);
    space.add_fem_constant("mu", cellField, mu);
    space.add_fem_constant("K", cellField, bulk);
    if (stiffens) {
        space.add_fem_constant("b", cellField, stiffening);
    }
    space.add_macro("F", "(Id(3)+Grad_u)");
    space.add_macro("I", "(pow(Det(F),-2/3)*Norm_sqr(F)-3)");
}

void FiniteElements::Impl::addContact(getfem::ga_workspace& space, const Fields& fields, As as) const
{
    addState(space, fields, as);
    space.add_fem_constant("lambda", vertexField, multipliers);
    space.add_fem_constant("r", cellField, contactR);
    space.add_fixed_size_constant("c", centre);
    space.add_fixed_size_constant("R", radius);
    space.add_fixed_size_constant("S", shaft);
    space.add_fixed_size_constant("a", alongShaft);
    space.add_macro("T", "((X+u-c).a)");
    space.add_macro("Q", "(X+u-c-(pos_part(T)-pos_part(T-1))*S)");
}

const Matrix& FiniteElements::Impl::linearTissue()
{
    if (gmm::mat_nrows(linear) == 0) {
        const Fields zero = split(std::vector<double>(size()));
        getfem::ga_workspace space;
        addTissue(space, zero);
        gmm::resize(linear, size(), size());
        space.add_expression(tissueEnergy(options, stiffens), volumeRule);
        space.set_assembled_matrix(linear);
        space.assembly(2);
    }
    return linear;
}

FiniteElements::FiniteElements(const TetMesh& mesh, std::span<const Material> materials, const SolveOptions& options)
    : impl_(std::make_unique<Impl>(options))
{
    gmm::set_traces_level(0);
    gmm::set_warning_level(0);
    defineLaws();
    impl_->addMesh(mesh);
    impl_->findFaces(mesh);
    impl_->addMaterials(mesh, materials);
}

FiniteElements::~FiniteElements() = default;

std::size_t FiniteElements::size() const noexcept
{
    return impl_->size();
}

std::size_t FiniteElements::displacements() const noexcept
{
    return 3 * impl_->nodes.size();
}

const std::vector<Vec3>& FiniteElements::nodes() const noexcept
{
    return impl_->nodes;
}

const std::vector<std::array<std::uint32_t, 6>>& FiniteElements::faceNodes() const noexcept
{
    return impl_->faceNodes;
}

const std::vector<char>& FiniteElements::freeFaces() const noexcept
{
    return impl_->freeFaces;
}

double FiniteElements::energy(const std::vector<double>& state) const
{
    const Impl::Fields fields = impl_->split(state);
    getfem::ga_workspace space;
    impl_->addTissue(space, fields);
    space.add_expression(tissueEnergy(impl_->options, impl_->stiffens), impl_->volumeRule,
                         getfem::mesh_region::all_convexes(), 0);
    space.assembly(0);
    return space.assembled_potential();
}

std::vector<double> FiniteElements::tissueForces(const std::vector<double>& state) const
{
    std::vector<double> forces(state.size());
    if (volume::isSmall(impl_->options.law)) {
        gmm::mult(impl_->linearTissue(), state, forces);
        return forces;
    }
    const Impl::Fields fields = impl_->split(state);
    getfem::ga_workspace space;
    impl_->addTissue(space, fields);
    space.add_expression(tissueEnergy(impl_->options, impl_->stiffens), impl_->volumeRule,
                         getfem::mesh_region::all_convexes(), 1);
    space.set_assembled_vector(forces);
    space.assembly(1);
    return forces;
}

SymmetricMatrix FiniteElements::tangent(const std::vector<double>& state) const
{
    const bool linear = volume::isSmall(impl_->options.law);
    const Impl::Fields fields = impl_->split(state);
    Matrix sum(state.size(), state.size());
    if (!linear) {
        getfem::ga_workspace space;
        impl_->addTissue(space, fields);
        space.add_expression(tissueEnergy(impl_->options, impl_->stiffens), impl_->volumeRule);
        space.set_assembled_matrix(sum);
        space.assembly(2);
    }
    if (impl_->touching.size() > 0) {
        Matrix contact(state.size(), state.size());
        getfem::ga_workspace space;
        impl_->addContact(space, fields);
        space.add_macro("N", "(Q/Norm(Q))");
        space.add_macro("C", "(min(pos_part(lambda-r*(Norm(Q)-R)),2*pos_part(lambda))/Norm(Q))");
        space.add_expression(contactTangentText, impl_->faceRule, impl_->touching);
        space.set_assembled_matrix(contact);
        space.assembly(2);
        gmm::add(contact, sum);
    }
    if (linear) {
        gmm::add(impl_->linearTissue(), sum);
    }
    SymmetricMatrix matrix;
    matrix.start.push_back(0);
    for (std::size_t c = 0; c < state.size(); ++c) {
        for (const auto& entry : sum[c]) {
            matrix.row.push_back(static_cast<int>(entry.c));
            matrix.value.push_back(entry.e);
        }
        matrix.start.push_back(matrix.row.size());
    }
    return matrix;
}

void FiniteElements::setObstacle(const Obstacle& obstacle)
{
    impl_->obstacle = obstacle;
    impl_->centre = {obstacle.centre.x, obstacle.centre.y, obstacle.centre.z};
    impl_->radius = {obstacle.radius};
    impl_->shaft = {obstacle.shaft.x, obstacle.shaft.y, obstacle.shaft.z};
    const Vec3 along = obstacle.fractions();
    impl_->alongShaft = {along.x, along.y, along.z};
}

void FiniteElements::findContact(const std::vector<double>& state)
{
    impl_->touching.clear();
    if (impl_->obstacle.radius <= 0.0) {
        return;
    }
    const double far = reach * impl_->obstacle.radius;
    for (std::size_t f = 0; f < impl_->faces.size(); ++f) {
        const Impl::Face& face = impl_->faces[f];
        const auto& six = impl_->faceNodes[f];
        const auto vertices = impl_->vertexField.ind_basic_dof_of_face_of_element(face.tet, face.side);
        const bool near = std::any_of(six.begin(), six.end(), [&](std::uint32_t n) {
            return impl_->obstacle.distance(impl_->nodes[n] + at(state, n)) < far;
        });
        const bool pressed =
            std::any_of(vertices.begin(), vertices.end(), [&](size_type v) { return impl_->multipliers[v] != 0.0; });
        if (impl_->freeFaces[f] != 0 && (near || pressed)) {
            impl_->touching.add(face.tet, face.side);
        }
    }
}

void FiniteElements::stiffenContact(const std::vector<double>& state)
{
    const auto area = [&](const std::array<std::uint32_t, 6>& six, double fraction) {
        const auto corner = [&](std::size_t c) { return impl_->nodes[six[c]] + fraction * at(state, six[c]); };
        return glm::length(glm::cross(corner(2) - corner(0), corner(5) - corner(0)));
    };
    for (std::size_t f = 0; f < impl_->faces.size(); ++f) {
        const double ratio = area(impl_->faceNodes[f], 1.0) / area(impl_->faceNodes[f], 0.0);
        const std::size_t cell = impl_->cellField.ind_basic_dof_of_element(impl_->faces[f].tet)[0];
        impl_->contactR[cell] = impl_->restR[cell] * std::clamp(ratio, 1.0, maxStretch);
    }
}

std::vector<double> FiniteElements::contactForces(const std::vector<double>& state) const
{
    std::vector<double> forces(state.size());
    if (impl_->touching.size() == 0) {
        return forces;
    }
    const Impl::Fields fields = impl_->split(state);
    getfem::ga_workspace space;
    impl_->addContact(space, fields);
    space.add_expression(contactEnergyText, impl_->faceRule, impl_->touching, 1);
    space.set_assembled_vector(forces);
    space.assembly(1);
    return forces;
}

double FiniteElements::updateMultipliers(const std::vector<double>& state)
{
    if (impl_->touching.size() == 0) {
        return 0.0;
    }
    const Impl::Fields fields = impl_->split(state);
    const std::size_t count = impl_->multipliers.size();
    const std::vector<double> zero(count);
    std::vector<double> load(count);
    Matrix mass(count, count);
    getfem::ga_workspace space;
    impl_->addContact(space, fields, Impl::As::given);
    space.add_fem_variable("v", impl_->vertexField, gmm::sub_interval(0, count), zero);
    space.add_expression(contactPressureText, impl_->faceRule, impl_->touching);
    space.set_assembled_vector(load);
    space.assembly(1);
    getfem::ga_workspace masses;
    masses.add_fem_variable("v", impl_->vertexField, gmm::sub_interval(0, count), zero);
    masses.add_expression("v*v/2", impl_->faceRule, impl_->touching);
    masses.set_assembled_matrix(mass);
    masses.assembly(2);
    for (std::size_t v = 0; v < count; ++v) {
        if (mass(v, v) == 0.0) {
            mass(v, v) = 1.0;  // not on a face that may touch
        }
    }
    std::vector<double> pressure(count);
    gmm::iteration until(1e-12, 0, 500);
    gmm::cg(mass, pressure, load, gmm::identity_matrix(), gmm::diagonal_precond<Matrix>(mass), until);

    double depth = 0.0;
    for (getfem::mr_visitor face(impl_->touching); !face.finished(); ++face) {
        const double r = impl_->contactR[impl_->cellField.ind_basic_dof_of_element(face.cv())[0]];
        for (const size_type v : impl_->vertexField.ind_basic_dof_of_face_of_element(face.cv(), face.f())) {
            depth = std::max(depth, std::abs(pressure[v] - impl_->multipliers[v]) / r);
        }
    }
    impl_->multipliers = std::move(pressure);
    return depth;
}

const std::vector<double>& FiniteElements::multipliers() const noexcept
{
    return impl_->multipliers;
}

void FiniteElements::setMultipliers(std::vector<double> multipliers)
{
    impl_->multipliers = std::move(multipliers);
}

std::vector<Vec3> FiniteElements::displacementAt(const std::vector<double>& state, std::span<const Vec3> rest) const
{
    if (rest.empty()) {
        return {};  // which GetFEM refuses
    }
    getfem::mesh_trans_inv points(impl_->mesh);
    for (const Vec3& p : rest) {
        points.add_point(bgeot::base_node(p.x, p.y, p.z));
    }
    const Impl::Fields fields = impl_->split(state);
    std::vector<double> values(3 * rest.size());
    getfem::interpolation(impl_->uField, points, fields.u, values, 2);
    std::vector<Vec3> u(rest.size());
    for (std::size_t i = 0; i < u.size(); ++i) {
        u[i] = at(values, i);
    }
    return u;
}

std::vector<std::array<double, 6>> FiniteElements::meanStress(const std::vector<double>& state) const
{
    const Impl::Fields fields = impl_->split(state);
    getfem::mesh_fem tensors(impl_->mesh);
    tensors.set_qdim(3, 3);
    tensors.set_classical_discontinuous_finite_element(0);
    const std::vector<double> zero(tensors.nb_dof());
    const gmm::sub_interval all(0, tensors.nb_dof());
    std::vector<double> sums(tensors.nb_dof());
    getfem::ga_workspace space;
    impl_->addTissue(space, fields, Impl::As::given);
    space.add_fem_variable("s", tensors, all, zero);
    space.add_expression(testedStress(impl_->options, impl_->stiffens), impl_->volumeRule);
    space.set_assembled_vector(sums);
    space.assembly(1);

    std::vector<std::array<double, 6>> stress(impl_->mesh.nb_convex());
    for (std::size_t t = 0; t < stress.size(); ++t) {
        const std::size_t first = tensors.ind_basic_dof_of_element(t)[0];
        const double volume = impl_->mesh.convex_area_estimate(t);
        constexpr std::array<std::size_t, 6> places{0, 4, 8, 7, 6, 3};
        for (std::size_t k = 0; k < places.size(); ++k) {
            stress[t][k] = sums[first + places[k]] / volume;
        }
    }
    return stress;
}

}  // namespace palpate::reference
