#include <studies/kernel/baselines/xpbd.h>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <memory>
#include <utility>

namespace palpate::studies {

constexpr double reach = 4e-3;  // how far from the sphere a tick looks for points that it may meet [m]
constexpr std::size_t tetsPerCell = 5;
constexpr std::size_t colours = 8 * tetsPerCell;

Xpbd::Xpbd(TetBody mesh, const XpbdOptions& options)
    : mesh_(std::move(mesh)), options_(options), substep_(static_cast<float>(options.tick / options.substeps))
{
    const std::size_t count = mesh_.points.size() + 1;
    u_.assign(count, Vec3f(0.0F));
    before_ = velocity_ = u_;
    touches_.assign(count, 0);
    for (std::uint32_t p = 0; p < mesh_.points.size(); ++p) {
        if (mesh_.outer[p] != 0 && mesh_.held[p] == 0) {
            outer_.push_back(p);
        }
    }
    near_.reserve(outer_.size());
    weigh();
    addBatches();
}

// A quarter of each tetrahedron's mass goes to each of its points.
void Xpbd::weigh()
{
    std::vector<double> mass(mesh_.points.size(), 0.0);
    for (std::size_t t = 0; t < mesh_.tets.size(); ++t) {
        const double quarter = 0.25 * options_.density * shapeOf(mesh_, t).volume;
        for (const std::uint32_t p : mesh_.tets[t]) {
            mass[p] += quarter;
        }
    }
    inverseMass_.assign(mass.size() + 1, 0.0F);
    for (std::size_t p = 0; p < mass.size(); ++p) {
        inverseMass_[p] = mesh_.held[p] != 0 ? 0.0F : static_cast<float>(1.0 / mass[p]);
    }
}

// Cells two apart share no point: eight colours of cells, and within a cell one tetrahedron after the other.
void Xpbd::addBatches()
{
    std::array<std::vector<std::size_t>, colours> coloured;
    volume::forEachIndex(Index3(0), mesh_.corners.size - 2, [&](Index3 c) {
        const std::size_t at = mesh_.corners.offset(c);
        const int parity = (c.x & 1) + 2 * (c.y & 1) + 4 * (c.z & 1);
        for (std::size_t t = mesh_.first[at]; t < mesh_.first[at + 1]; ++t) {
            if (mesh_.moves(t)) {
                coloured[static_cast<std::size_t>(parity) * tetsPerCell + t - mesh_.first[at]].push_back(t);
            }
        }
    });
    for (const auto& tets : coloured) {
        for (std::size_t i = 0; i < tets.size(); i += lanes) {
            Batch& batch = batches_.emplace_back();
            for (std::size_t lane = 0; lane < lanes; ++lane) {
                fill(batch, lane, i + lane < tets.size() ? tets[i + lane] : mesh_.tets.size());
            }
        }
    }
}

// A lane without a tetrahedron moves nothing.
void Xpbd::fill(Batch& batch, std::size_t lane, std::size_t tet) const
{
    const bool empty = tet == mesh_.tets.size();
    for (std::size_t i = 0; i < 4; ++i) {
        batch.points[i][lane] = empty ? static_cast<std::uint32_t>(mesh_.points.size()) : mesh_.tets[tet][i];
        batch.mass[i][lane] = inverseMass_[batch.points[i][lane]];
    }
    const TetShape shape = empty ? TetShape{{}, 1.0} : shapeOf(mesh_, tet);
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            batch.gradient[i][j][lane] =
                empty ? 0.0F : static_cast<float>(shape.gradient[static_cast<std::size_t>(i) + 1][j]);
        }
    }
    const double square = static_cast<double>(substep_) * static_cast<double>(substep_);
    const double mu = empty ? 1.0 : mesh_.mu[tet];
    const double l = mu + (empty ? 1.0 : mesh_.lambda[tet]);
    batch.deviatoric[lane] = static_cast<float>(1.0 / (mu * shape.volume * square));
    batch.hydrostatic[lane] = static_cast<float>(1.0 / (l * shape.volume * square));
    batch.rest[lane] = static_cast<float>(1.0 + mu / l);
}

void Xpbd::project(const Batch& b)
{
    float u[4][3][lanes], move[4][3][lanes];
    for (int i = 0; i < 4; ++i) {
        for (std::size_t l = 0; l < lanes; ++l) {
            const Vec3f& at = u_[b.points[i][l]];
            u[i][0][l] = at.x;
            u[i][1][l] = at.y;
            u[i][2][l] = at.z;
        }
    }
    for (std::size_t l = 0; l < lanes; ++l) {
        float f[3][3];  // deformation gradient, row by row
        for (int r = 0; r < 3; ++r) {
            for (int c = 0; c < 3; ++c) {
                f[r][c] = (r == c ? 1.0F : 0.0F) + (u[1][r][l] - u[0][r][l]) * b.gradient[0][c][l] +
                          (u[2][r][l] - u[0][r][l]) * b.gradient[1][c][l] + (u[3][r][l] - u[0][r][l]) * b.gradient[2][c][l];
            }
        }
        float cofactor[3][3];
        for (int r = 0; r < 3; ++r) {
            for (int c = 0; c < 3; ++c) {
                const int r1 = (r + 1) % 3, r2 = (r + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
                cofactor[r][c] = f[r1][c1] * f[r2][c2] - f[r1][c2] * f[r2][c1];
            }
        }
        const float det = f[0][0] * cofactor[0][0] + f[0][1] * cofactor[0][1] + f[0][2] * cofactor[0][2];
        float square = 0.0F;
        for (int r = 0; r < 3; ++r) {
            square += f[r][0] * f[r][0] + f[r][1] * f[r][1] + f[r][2] * f[r][2];
        }
        const float size = std::sqrt(square);
        // Gradients of both constraints by the last three points; the first one's is minus their sum.
        float d[4][3], h[4][3];
        for (int r = 0; r < 3; ++r) {
            d[0][r] = h[0][r] = 0.0F;
            for (int i = 0; i < 3; ++i) {
                const float gx = b.gradient[i][0][l], gy = b.gradient[i][1][l], gz = b.gradient[i][2][l];
                d[i + 1][r] = (f[r][0] * gx + f[r][1] * gy + f[r][2] * gz) / size;
                h[i + 1][r] = cofactor[r][0] * gx + cofactor[r][1] * gy + cofactor[r][2] * gz;
                d[0][r] -= d[i + 1][r];
                h[0][r] -= h[i + 1][r];
            }
        }
        float dd = b.deviatoric[l], dh = 0.0F, hh = b.hydrostatic[l];
        for (int i = 0; i < 4; ++i) {
            const float w = b.mass[i][l];
            dd += w * (d[i][0] * d[i][0] + d[i][1] * d[i][1] + d[i][2] * d[i][2]);
            dh += w * (d[i][0] * h[i][0] + d[i][1] * h[i][1] + d[i][2] * h[i][2]);
            hh += w * (h[i][0] * h[i][0] + h[i][1] * h[i][1] + h[i][2] * h[i][2]);
        }
        const float over = det - b.rest[l];
        const float scale = -1.0F / (dd * hh - dh * dh);
        const float byD = scale * (hh * size - dh * over);
        const float byH = scale * (dd * over - dh * size);
        for (int i = 0; i < 4; ++i) {
            for (int r = 0; r < 3; ++r) {
                move[i][r][l] = b.mass[i][l] * (byD * d[i][r] + byH * h[i][r]);
            }
        }
    }
    for (int i = 0; i < 4; ++i) {
        for (std::size_t l = 0; l < lanes; ++l) {
            u_[b.points[i][l]] += Vec3f(move[i][0][l], move[i][1][l], move[i][2][l]);
        }
    }
}

// The impulse that it takes is the contact's force in this substep.
void Xpbd::push(Vec3 centre, double radius)
{
    for (const std::uint32_t p : near_) {
        const Vec3 from = mesh_.points[p] + Vec3(u_[p]) - centre;
        const double distance = glm::length(from);
        if (distance >= radius || distance <= 0.0) {
            continue;
        }
        const Vec3 out = (radius / distance - 1.0) * from;
        u_[p] += Vec3f(out);
        force_ -= out / static_cast<double>(inverseMass_[p]);
        touched_ += touches_[p] == 0 ? 1 : 0;
        touches_[p] = 1;
    }
}

chainmail::ElasticResult Xpbd::step(Vec3 centre, double radius)
{
    const Vec3 from = hasCentre_ ? centre_ : centre;
    centre_ = centre;
    hasCentre_ = true;
    for (const std::uint32_t p : near_) {
        touches_[p] = 0;
    }
    near_.clear();
    std::ranges::copy_if(outer_, std::back_inserter(near_), [&](std::uint32_t p) {
        return radius > 0.0 && glm::distance(mesh_.points[p] + Vec3(u_[p]), centre) < radius + reach;
    });
    force_ = Vec3(0.0);
    touched_ = 0;
    const float keep = 1.0F / (1.0F + static_cast<float>(options_.damping) * substep_);
    for (int s = 1; s <= options_.substeps; ++s) {
        before_ = u_;
        for (std::size_t p = 0; p + 1 < u_.size(); ++p) {
            u_[p] += substep_ * velocity_[p];
        }
        for (std::size_t i = 0; i < batches_.size(); ++i) {
            project(batches_[backwards_ ? batches_.size() - 1 - i : i]);
        }
        backwards_ = !backwards_;
        push(glm::mix(from, centre, static_cast<double>(s) / options_.substeps), radius);
        for (std::size_t p = 0; p + 1 < u_.size(); ++p) {
            velocity_[p] = keep / substep_ * (u_[p] - before_[p]);
        }
    }
    const double square = static_cast<double>(substep_) * static_cast<double>(substep_);
    force_ /= square * options_.substeps;
    chainmail::ElasticResult result;
    result.contacts = static_cast<std::uint32_t>(touched_);
    result.cycles = static_cast<std::uint32_t>(options_.substeps);
    return result;
}

Vec3 Xpbd::displacement(Vec3 rest) const
{
    return valueAt(placeOf(mesh_, rest), [this](std::uint32_t p) { return Vec3(u_[p]); });
}

double Xpbd::energy() const
{
    double sum = 0.0;
    for (std::size_t t = 0; t < mesh_.tets.size(); ++t) {
        const TetShape shape = shapeOf(mesh_, t);
        Mat3 h(0.0);  // displacement gradient
        for (std::size_t i = 0; i < 4; ++i) {
            h += glm::outerProduct(Vec3(u_[mesh_.tets[t][i]]), shape.gradient[i]);
        }
        const double trace = h[0][0] + h[1][1] + h[2][2];
        const double square = glm::dot(h[0], h[0]) + glm::dot(h[1], h[1]) + glm::dot(h[2], h[2]);
        const double swelling = glm::determinant(Mat3(1.0) + h) - 1.0;
        const double l = mesh_.lambda[t] + mesh_.mu[t];
        // |F|^2 - 3 and (J - 1 - mu / l)^2 - (mu / l)^2, without the differences of large numbers.
        sum += shape.volume * (mesh_.mu[t] * (trace + 0.5 * square - swelling) + 0.5 * l * swelling * swelling);
    }
    return sum;
}

Vec3 Xpbd::momentum() const
{
    Vec3 sum(0.0);
    for (std::size_t p = 0; p < mesh_.points.size(); ++p) {
        if (inverseMass_[p] > 0.0F) {
            sum += Vec3(velocity_[p]) / static_cast<double>(inverseMass_[p]);
        }
    }
    return sum;
}

TrialModel xpbdModel(TetBody mesh, const XpbdOptions& options)
{
    auto tets = std::make_shared<Xpbd>(std::move(mesh), options);
    return {[tets](const TrialLoad& load) { return tets->step(load.path().at(load.pose()), load.path().tool.radius); },
            [tets](Vec3 rest) { return tets->displacement(rest); }, [tets] { return tets->force(); },
            [tets] { return tets->touched(); }};
}

}  // namespace palpate::studies
