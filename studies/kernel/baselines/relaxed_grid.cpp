#include <studies/kernel/baselines/relaxed_grid.h>

#include <studies/kernel/node_values.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::studies {

using namespace chainmail;

namespace {

constexpr double stable = 1.8;       // weight times the spectral radius; 2 diverges
constexpr int longestCycle = 5;      // of weights
constexpr double lowest = 1.0 / 32;  // what a cycle damps evenly, in spectral radii
constexpr double highest = 1.1;      // with room for what the estimate of the radius lacks

// The k-th of `count` weights. Cycles are short, because the sphere takes part between sweeps; the last weight of a cycle
// is the smallest, so that what the large ones raise is damped after them.
double weightOf(int k, int count, double radius)
{
    if (count == 1) {
        return stable / radius;
    }
    const int cycle = std::min(count, longestCycle);
    const double low = lowest * radius, high = highest * radius;
    const double root = std::cos(std::numbers::pi * (2.0 * (k % cycle) + 1.0) / (2.0 * cycle));
    return 1.0 / (0.5 * (high + low) - 0.5 * (high - low) * root);
}

Index3 lowestNode(const CellLevel& level)
{
    Index3 low = level.nodes.size;
    volume::forEachIndex(Index3(0), level.nodes.size - 1,
                         [&](Index3 n) { low = level.diagonal[level.nodes.offset(n)] > 0.0F ? glm::min(low, n) : low; });
    return low;
}

Index3 highestNode(const CellLevel& level)
{
    Index3 high(0);
    volume::forEachIndex(Index3(0), level.nodes.size - 1,
                         [&](Index3 n) { high = level.diagonal[level.nodes.offset(n)] > 0.0F ? glm::max(high, n) : high; });
    return high;
}

int cellsAround(const CellLevel& level, Index3 n)
{
    int cells = 0;
    volume::forEachIndex(glm::max(n - 1, Index3(0)), n,
                         [&](Index3 c) { cells += level.mu[level.nodes.offset(c)] > 0.0F ? 1 : 0; });
    return cells;
}

// Two rows beside air: links of one that is free let pass a strain of 1.
volume::TissueTable evenTable()
{
    volume::TissueTable table;
    table.rows.resize(3);
    table.rows[1].compress = 0.0;
    table.rows[1].stretch = 2.0;
    table.rows[1].shear = 1.0;
    table.rows[2] = table.rows[1];
    table.rows[2].fixed = true;
    return table;
}

std::vector<std::uint8_t> freeOrFixed(const CellLevel& level)
{
    std::vector<std::uint8_t> rows(level.nodes.count(), 0);
    for (std::size_t n = 0; n < rows.size(); ++n) {
        rows[n] = level.diagonal[n] > 0.0F ? (level.fixed[n] != 0 ? 2 : 1) : 0;
    }
    return rows;
}

}  // namespace

RelaxedGrid::RelaxedGrid(const CellLevel& level, const volume::DistanceField& surface, const volume::Box& reach)
    : level_(level), window_(highestNode(level) - lowestNode(level) + 1), scratch_(window_.layout.scratchSize())
{
    window_.place(level, lowestNode(level), true);
    nodes_ = static_cast<std::size_t>(std::ranges::count_if(level.diagonal, [](float d) { return d > 0.0F; }));
    findContacts(surface, reach);
}

void RelaxedGrid::findContacts(const volume::DistanceField& surface, const volume::Box& reach)
{
    const auto& grid = level_.nodes;
    volume::forEachIndex(window_.low, window_.low + window_.size() - 1, [&](Index3 n) {
        const std::size_t at = grid.offset(n);
        const Vec3 rest = grid.position(n);
        const bool inReach = glm::clamp(rest, reach.low, reach.high) == rest;
        const int cells = cellsAround(level_, n);
        if (inReach && level_.fixed[at] == 0 && cells > 0 && cells < 8) {
            ContactNode contact;
            contact.at = window_.at(n);
            contact.node = static_cast<Node>(at);
            contact.rest = rest;
            contact.surface = surface.distance(rest);
            contacts_.push_back(contact);
        }
    });
}

std::size_t RelaxedGrid::project(const RigidSphere& sphere) noexcept
{
    for (ContactNode& c : contacts_) {
        c.active = false;
    }
    return putOn(sphere);
}

// Nodes that the sphere holds or covers go to its surface.
std::size_t RelaxedGrid::putOn(const RigidSphere& sphere) noexcept
{
    std::size_t held = 0;
    for (ContactNode& c : contacts_) {
        const Vec3 from = c.rest + window_.value(Field::u, c.at) - sphere.centre;
        const double distance = glm::length(from);
        const double gap = distance - sphere.radius + c.surface;
        c.active = c.active || gap < 0.0;
        if (c.active) {
            c.normal = from / std::max(distance, 1e-9);
            window_.add(Field::u, c.at, -gap * c.normal);
            ++held;
        }
    }
    return held;
}

// What pushes the sphere stays on it: a step into it and back again would slide along it. What pulls is let go. Along the
// sphere go `fraction` of the forces, so that no step is long beside its radius.
void RelaxedGrid::letGo(double fraction) noexcept
{
    for (ContactNode& c : contacts_) {
        if (c.active) {
            const Vec3 a = window_.value(Field::a, c.at);
            const double push = glm::dot(a, c.normal);
            c.active = push >= 0.0;
            const Vec3 along = a - std::max(push, 0.0) * c.normal;
            window_.add(Field::a, c.at, fraction * along - a);
        }
    }
}

void RelaxedGrid::sweep(const RigidSphere& sphere, int count) noexcept
{
    const Kernels& k = kernels();
    float* const a = window_.field(Field::a);
    float* const u = window_.field(Field::u);
    for (int i = 0; i < count; ++i) {
        const double weight = weightOf(i, count, level_.radius);
        k.apply(window_.layout, window_.stiffness(), u, a, scratch_.data());
        letGo(std::min(1.0, stable / (weight * level_.radius)));
        k.smooth(static_cast<float>(weight), window_.diagonal.data(), window_.field(Field::f), a, u, window_.layout.count);
        putOn(sphere);
    }
}

Vec3 RelaxedGrid::force()
{
    Index3 low = window_.size(), high(-1);
    for (const ContactNode& c : contacts_) {
        if (c.active) {
            const Index3 n = level_.nodes.node(c.node) - window_.low;
            low = glm::min(low, n);
            high = glm::max(high, n);
        }
    }
    if (high.x < 0) {
        return Vec3(0.0);
    }
    low = glm::max(low - 1, Index3(0));
    const Index3 size = glm::min(high + 1, window_.size() - 1) - low + 1;
    const Layout part = Layout::of(size.x, size.y, size.z);
    for (Floats* cells : {&partMu_, &partLambda_}) {
        cells->assign(part.count + Layout::lanes, 0.0F);
    }
    for (Floats* field : {&partU_, &partA_}) {
        field->assign(part.fieldSize(), 0.0F);
    }
    const auto row = static_cast<std::size_t>(size.x);
    for (int k = 0; k < size.z; ++k) {
        for (int j = 0; j < size.y; ++j) {
            const std::size_t from = window_.layout.at(low.x, low.y + j, low.z + k);
            const std::size_t to = part.at(0, j, k);
            const bool cells = j + 1 < size.y && k + 1 < size.z;
            std::copy_n(&window_.mu[from], cells ? row - 1 : 0, &partMu_[to]);
            std::copy_n(&window_.lambda[from], cells ? row - 1 : 0, &partLambda_[to]);
            for (std::size_t c = 0; c < 3; ++c) {
                std::copy_n(window_.field(Field::u) + c * window_.layout.count + from, row, &partU_[c * part.count + to]);
            }
        }
    }
    scratch_.resize(std::max(scratch_.size(), part.scratchSize()));
    kernels().apply(part, {partMu_.data(), partLambda_.data()}, partU_.data(), partA_.data(), scratch_.data());
    Vec3 sum(0.0);
    for (const ContactNode& c : contacts_) {
        if (c.active) {
            const Index3 n = level_.nodes.node(c.node) - window_.low - low;
            const float* const a = &partA_[part.at(n.x, n.y, n.z)];
            const Vec3 push(a[0], a[part.count], a[2 * part.count]);
            sum -= std::max(0.0, glm::dot(push, c.normal)) * c.normal;
        }
    }
    return sum;
}

std::size_t RelaxedGrid::wayTo(const RigidSphere& sphere, std::vector<Seed>& out) const
{
    out.clear();
    for (const ContactNode& c : contacts_) {
        const Vec3 from = c.rest + window_.value(Field::u, c.at) - sphere.centre;
        const double distance = glm::length(from);
        const double gap = distance - sphere.radius + c.surface;
        if (gap < 0.0) {
            out.push_back({c.node, Vec3f(-gap * from / std::max(distance, 1e-9))});
        }
    }
    return out.size();
}

void RelaxedGrid::add(Node node, Vec3f du) noexcept
{
    window_.add(Field::u, window_.at(level_.nodes.node(node)), Vec3(du));
}

Vec3 RelaxedGrid::displacement(Vec3 rest) const noexcept
{
    const auto& grid = level_.nodes;
    return valueAt(
        grid, rest, [&](Index3 n) { return level_.diagonal[grid.offset(n)] > 0.0F; },
        [&](Index3 n) { return window_.value(Field::u, window_.at(n)); });
}

double RelaxedGrid::imbalance() noexcept
{
    float* const z = window_.field(Field::z);
    kernels().apply(window_.layout, window_.stiffness(), window_.field(Field::u), window_.field(Field::a), scratch_.data());
    letGo(1.0);
    kernels().smoothFirst(1.0F, window_.diagonal.data(), window_.field(Field::a), z, window_.layout.count);
    float most = 0.0F;
    for (std::size_t i = 0; i < 3 * window_.layout.count; ++i) {
        most = std::max(most, std::abs(z[i]));
    }
    return static_cast<double>(most);
}

IncrementMail::IncrementMail(const CellLevel& level)
    : lattice_(level.nodes, freeOrFixed(level), evenTable()), scratch_(lattice_), du_(level.nodes.count(), Vec3f(0.0F))
{
}

std::span<const Node> IncrementMail::spread(std::span<const Seed> seeds, double strain)
{
    for (const Node n : scratch_.moved) {
        du_[n] = Vec3f(0.0F);
    }
    propagateFifo(lattice_, du_, scratch_, seeds, static_cast<float>(strain));
    return scratch_.moved;
}

}  // namespace palpate::studies
