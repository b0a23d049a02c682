#include <studies/kernel/baselines/factored.h>

#include <base/error.h>
#include <base/folds.h>

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::studies {

struct TetFactor::Impl {
    Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> factors;
};

namespace {

// The lower half of the block that point `q` puts into the rows of point `p`.
void addBlock(const Mat3& block, std::uint32_t p, std::uint32_t q, std::vector<Eigen::Triplet<double>>& entries)
{
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            const Eigen::Index row = 3 * Eigen::Index{p} + i, column = 3 * Eigen::Index{q} + j;
            if (row >= column) {
                entries.emplace_back(row, column, block[j][i]);
            }
        }
    }
}

constexpr double reach = 0.3;      // of points beside the sphere's way, in radii
constexpr double settled = 1e-10;  // no contact is further off the sphere [m]
constexpr std::size_t maxSteps = 100;
constexpr std::size_t together = 48;  // columns solved at once
constexpr std::size_t chunk = 2048;   // unknowns whose sums stay in the first cache

double distanceToSegment(Vec3 p, Vec3 a, Vec3 b)
{
    const Vec3 way = b - a;
    const double length = glm::dot(way, way);
    const double t = length > 0.0 ? std::clamp(glm::dot(p - a, way) / length, 0.0, 1.0) : 0.0;
    return glm::distance(p, a + t * way);
}

}  // namespace

TetFactor::TetFactor(const TetBody& mesh, std::span<const std::uint32_t> unknown, std::size_t unknowns)
    : impl_(std::make_unique<Impl>())
{
    std::vector<Eigen::Triplet<double>> entries;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const auto stiffness = stiffnessOf(mesh, t);
        for (std::size_t ab = 0; ab < 16; ++ab) {
            const std::uint32_t p = unknown[mesh.tets[t][ab / 4]], q = unknown[mesh.tets[t][ab % 4]];
            if (p != held && q != held) {
                addBlock(stiffness[ab / 4][ab % 4], p, q, entries);
            }
        }
    }
    const auto size = static_cast<Eigen::Index>(3 * unknowns);
    Eigen::SparseMatrix<double> matrix(size, size);
    matrix.setFromTriplets(entries.begin(), entries.end());
    impl_->factors.compute(matrix);
    base::failIf(impl_->factors.info() != Eigen::Success,
                 "prefactored tetrahedra: the stiffness is not positive definite; is the body held?");
}

TetFactor::~TetFactor() = default;

void TetFactor::solve(std::span<double> columns) const
{
    const Eigen::Index rows = impl_->factors.rows();
    Eigen::Map<Eigen::MatrixXd> all(columns.data(), rows, static_cast<Eigen::Index>(columns.size()) / rows);
    all = impl_->factors.solve(all).eval();
}

FactoredTets::FactoredTets(TetBody mesh, const TrialPath& path) : mesh_(std::move(mesh))
{
    base::failIf(path.tool.kind != TrialKind::sphere, "prefactored tetrahedra: {} is no sphere; press with a sphere",
                 path.tool.name);
    for (const std::uint8_t held : mesh_.held) {
        unknown_.push_back(held != 0 ? TetFactor::held : static_cast<std::uint32_t>(unknowns_++));
    }
    findContacts(path);
    base::failIf(contacts_.empty(),
                 "prefactored tetrahedra: the tool meets no point of the surface; take a smaller spacing");
    solveColumns();
    u_.assign(3 * unknowns_, 0.0F);
}

void FactoredTets::findContacts(const TrialPath& path)
{
    const Vec3 in = path.start + path.press * path.inward;
    const Vec3 across = in + path.drag * path.sideways;
    for (std::uint32_t p = 0; p < mesh_.points.size(); ++p) {
        const double away =
            std::min(distanceToSegment(mesh_.points[p], path.start, in), distanceToSegment(mesh_.points[p], in, across));
        if (mesh_.outer[p] != 0 && mesh_.held[p] == 0 && away < (1.0 + reach) * path.tool.radius) {
            contacts_.push_back({p});
        }
    }
}

void FactoredTets::solveColumns()
{
    const TetFactor factors(mesh_, unknown_, unknowns_);
    const std::size_t rows = 3 * unknowns_, count = 3 * contacts_.size();
    columns_.resize(rows * count);
    compliance_.resize(contacts_.size() * contacts_.size());
    std::vector<double> right;
    for (std::size_t first = 0; first < count; first += together) {
        const std::size_t some = std::min(together, count - first);
        right.assign(rows * some, 0.0);
        for (std::size_t k = 0; k < some; ++k) {
            const std::size_t j = first + k;
            right[k * rows + 3 * unknown_[contacts_[j / 3].point] + j % 3] = 1.0;
        }
        factors.solve(right);
        std::ranges::transform(right, columns_.begin() + static_cast<std::ptrdiff_t>(first * rows),
                               [](double v) { return static_cast<float>(v); });
        for (std::size_t k = 0; k < some; ++k) {
            const std::size_t j = first + k;
            for (std::size_t i = 0; i < contacts_.size(); ++i) {
                const double* at = &right[k * rows + 3 * unknown_[contacts_[i].point]];
                compliance_[j / 3 * contacts_.size() + i][static_cast<int>(j % 3)] = {at[0], at[1], at[2]};
            }
        }
    }
}

// Displacements of the contacts by their forces. Summed anew each time, so that no rounding is carried from tick to tick.
void FactoredTets::follow()
{
    const std::size_t count = contacts_.size();
    for (Contact& c : contacts_) {
        c.u = Vec3(0.0);
    }
    for (std::size_t i = 0; i < count; ++i) {
        if (contacts_[i].force == Vec3(0.0)) {
            continue;
        }
        for (std::size_t j = 0; j < count; ++j) {
            contacts_[j].u += compliance_[i * count + j] * contacts_[i].force;
        }
    }
}

// Takes the points that lie inside the sphere, or are pushed by it, with their normals. Returns how far one of them is off
// the sphere at most [m].
double FactoredTets::meet(Vec3 centre, double radius)
{
    double off = 0.0;
    active_.clear();
    for (std::uint32_t i = 0; i < contacts_.size(); ++i) {
        const Vec3 from = mesh_.points[contacts_[i].point] + contacts_[i].u - centre;
        const double gap = glm::length(from) - radius;
        if (gap < 0.0 || contacts_[i].force != Vec3(0.0)) {
            active_.push_back({i, glm::normalize(from), gap});
            off = std::max(off, std::abs(gap));
        }
    }
    return off;
}

// Forces along these normals that bring the active points to the sphere; points that would have to be pulled drop out.
void FactoredTets::balance()
{
    Eigen::VectorXd push;
    for (bool pulls = true; pulls && !active_.empty();) {
        const auto count = static_cast<Eigen::Index>(active_.size());
        Eigen::MatrixXd matrix(count, count);
        Eigen::VectorXd right(count);
        for (Eigen::Index i = 0; i < count; ++i) {
            const Active& a = active_[static_cast<std::size_t>(i)];
            for (Eigen::Index j = 0; j <= i; ++j) {
                const Active& b = active_[static_cast<std::size_t>(j)];
                matrix(i, j) = glm::dot(a.normal, compliance_[b.contact * contacts_.size() + a.contact] * b.normal);
            }
            right[i] = glm::dot(a.normal, contacts_[a.contact].u) - a.gap;
        }
        push = matrix.selfadjointView<Eigen::Lower>().llt().solve(right);
        std::size_t at = 0;
        const std::size_t before = active_.size();
        std::erase_if(active_, [&](const Active&) { return push[static_cast<Eigen::Index>(at++)] <= 0.0; });
        pulls = active_.size() < before;
    }
    for (Contact& c : contacts_) {
        c.force = Vec3(0.0);
    }
    for (std::size_t i = 0; i < active_.size(); ++i) {
        contacts_[active_[i].contact].force = push[static_cast<Eigen::Index>(i)] * active_[i].normal;
    }
}

chainmail::ElasticResult FactoredTets::press(Vec3 centre, double radius)
{
    double off = meet(centre, radius);
    for (steps_ = 0; off > settled && steps_ < maxSteps; ++steps_) {
        balance();
        follow();
        off = meet(centre, radius);
    }
    chainmail::ElasticResult result;
    touched_ = 0;
    for (const Contact& c : contacts_) {
        touched_ += c.force != Vec3(0.0) ? 1 : 0;
        result.energy += 0.5 * glm::dot(c.force, c.u);
        result.depth = std::max(result.depth, radius - glm::distance(mesh_.points[c.point] + c.u, centre));
    }
    result.contacts = static_cast<std::uint32_t>(touched_);
    result.cycles = static_cast<std::uint32_t>(steps_);
    addColumns();
    return result;
}

void FactoredTets::addColumns()
{
    if (touched_ == 0 && atRest_) {
        return;
    }
    atRest_ = touched_ == 0;
    const std::size_t rows = 3 * unknowns_;
    for (std::size_t low = 0; low < rows; low += chunk) {
        const std::size_t high = std::min(low + chunk, rows);
        std::fill(u_.begin() + static_cast<std::ptrdiff_t>(low), u_.begin() + static_cast<std::ptrdiff_t>(high), 0.0F);
        for (std::size_t i = 0; i < contacts_.size(); ++i) {
            const glm::vec3 f(contacts_[i].force);
            if (f == glm::vec3(0.0F)) {
                continue;
            }
            const float* x = &columns_[3 * i * rows];
            const float* y = x + rows;
            const float* z = y + rows;
            for (std::size_t k = low; k < high; ++k) {
                u_[k] += f.x * x[k] + f.y * y[k] + f.z * z[k];
            }
        }
    }
}

Vec3 FactoredTets::pointAt(std::uint32_t p) const noexcept
{
    const std::uint32_t n = unknown_[p];
    if (n == TetFactor::held) {
        return Vec3(0.0);
    }
    const std::size_t at = 3 * static_cast<std::size_t>(n);
    return Vec3(glm::vec3(u_[at], u_[at + 1], u_[at + 2]));
}

Vec3 FactoredTets::displacement(Vec3 rest) const
{
    return valueAt(placeOf(mesh_, rest), [this](std::uint32_t p) { return pointAt(p); });
}

Vec3 FactoredTets::force() const
{
    return -base::sumOf(contacts_, &Contact::force, Vec3(0.0));
}

TrialModel factoredModel(TetBody mesh, const TrialPath& path)
{
    auto tets = std::make_shared<FactoredTets>(std::move(mesh), path);
    return {[tets](const TrialLoad& load) { return tets->press(load.path().at(load.pose()), load.path().tool.radius); },
            [tets](Vec3 rest) { return tets->displacement(rest); }, [tets] { return tets->force(); },
            [tets] { return tets->touched(); }};
}

}  // namespace palpate::studies
