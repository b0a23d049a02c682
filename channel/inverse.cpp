#include <channel/inverse.h>

#include <channel/lanes.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::channel {
namespace {

constexpr float flat = 0.05F;  // a cell whose volume anywhere falls under this share counts as folded
constexpr std::size_t mostBins = 1U << 22U;
constexpr float edgeWithout = 0.57F;  // no cell is folded whose edges change by less (a root of a third) [spacings]

glm::vec3 vec(Lanes v) noexcept
{
    return {v[0], v[1], v[2]};
}

glm::ivec3 corner(int k) noexcept
{
    return {k & 1, k / 2 & 1, k / 4};
}

}  // namespace

bool Inverse::Box::holds(glm::vec3 p) const noexcept
{
    return glm::all(glm::greaterThanEqual(p, low)) && glm::all(glm::lessThanEqual(p, high));
}

void Inverse::Box::add(glm::vec3 p) noexcept
{
    const bool none = low.x > high.x;
    low = none ? p : glm::min(low, p);
    high = none ? p : glm::max(high, p);
}

Inverse::Inverse(glm::ivec3 size, float perMetre) : size_(glm::max(size, 0)), perMetre_(perMetre)
{
    checked_.resize(base::countOf(size_), 0);
}

Inverse::Local Inverse::inCell(glm::ivec3 cell, glm::vec3 part) const noexcept
{
    const std::size_t row = static_cast<std::size_t>(size_.x), layer = row * static_cast<std::size_t>(size_.y);
    const glm::vec4* u = &u_[at(cell)];
    const auto edge = [&](std::size_t from) { return lanes(u[from + 1]) - lanes(u[from]); };
    const Lanes x00 = edge(0), x10 = edge(row), x01 = edge(layer), x11 = edge(layer + row);
    const Lanes y0 = lanes(u[0]) + part.x * x00, y1 = lanes(u[row]) + part.x * x10, y2 = lanes(u[layer]) + part.x * x01,
                y3 = lanes(u[layer + row]) + part.x * x11;
    const Lanes z0 = y0 + part.y * (y1 - y0), z1 = y2 + part.y * (y3 - y2);
    const Lanes x0 = x00 + part.y * (x10 - x00), x1 = x01 + part.y * (x11 - x01);
    const Lanes y = (y1 - y0) + part.z * ((y3 - y2) - (y1 - y0));
    const glm::mat3 gradient(vec(x0 + part.z * (x1 - x0)), vec(y), vec(z1 - z0));
    return {perMetre_ * vec(z0 + part.z * (z1 - z0)), glm::mat3(1.0F) + perMetre_ * gradient};
}

Inverse::Local Inverse::local(glm::vec3 g) const noexcept
{
    const glm::vec3 last(size_ - 1);
    if (u_.empty() || !(g.x >= 0 && g.y >= 0 && g.z >= 0 && g.x < last.x && g.y < last.y && g.z < last.z))
        return {};
    const glm::ivec3 cell(g);
    return inCell(cell, g - glm::vec3(cell));
}

// Solves shift + share u(g + shift) = 0; whether it got there, and to tissue that is not inside out.
bool Inverse::newton(glm::vec3 g, float fraction, int steps, float enough, glm::vec3& shift) const noexcept
{
    constexpr float furthest = 2;  // step [spacings]: beyond, the cell's gradient says nothing
    for (int i = 0; i <= steps; ++i) {
        const Local here = local(g + shift);
        const glm::vec3 residual = shift + fraction * here.u;
        const glm::mat3 slope = (1 - fraction) * glm::mat3(1.0F) + fraction * here.deformation;
        const float volume = glm::determinant(slope);
        if (std::max({std::abs(residual.x), std::abs(residual.y), std::abs(residual.z)}) < enough)
            return volume > 0;
        if (!(volume > 1e-6F) || i == steps)
            return false;
        const glm::vec3 step = glm::inverse(slope) * residual;
        const float length = glm::length(step);
        shift -= length > furthest ? step * (furthest / length) : step;
    }
    return false;
}

// The place where the material is on its way from rest: for small t the solution is near, and it moves on with t.
bool Inverse::alongTheWay(glm::vec3 g, float enough, glm::vec3& shift) const noexcept
{
    constexpr int parts = 12;
    shift = glm::vec3(0);
    for (int k = 1; k < parts; ++k)
        if (!newton(g, static_cast<float>(k) / parts, 4, enough, shift))
            return false;
    return newton(g, 1, 8, enough, shift);
}

void Inverse::follow(glm::vec3 g, glm::vec3& shift, float enough) const noexcept
{
    if (!folded_.holds(g)) {
        if (newton(g, 1, 5, enough, shift))
            return;
        shift = glm::vec3(0);
        if (newton(g, 1, 5, enough, shift) || alongTheWay(g, enough, shift))
            return;
    }
    const Answer answer = searched(g);
    shift = answer.cost >= 0 ? answer.shift : glm::vec3(0);
}

Inverse::Box Inverse::seen(glm::ivec3 cell) const noexcept
{
    Box box;
    for (int k = 0; k < 8; ++k) {
        const glm::ivec3 n = cell + corner(k);
        box.add(glm::vec3(n) + perMetre_ * glm::vec3(u_[at(n)]));
    }
    return box;
}

// Newton's method inside one cell, from `part` of the way along its edges; whether something of the cell is seen at `g`.
bool Inverse::solveInCell(glm::ivec3 cell, glm::vec3 g, glm::vec3& part, float& volume) const noexcept
{
    constexpr float edge = 1e-3F, beyond = 0.5F;
    constexpr int steps = 10;
    for (int i = 0; i < steps; ++i) {
        const Local here = inCell(cell, part);
        const glm::vec3 miss = glm::vec3(cell) + part + here.u - g;
        volume = glm::determinant(here.deformation);
        if (glm::length(miss) < 0.5F * close && glm::all(glm::lessThanEqual(glm::abs(part - 0.5F), glm::vec3(0.5F + edge))))
            return true;
        if (std::abs(volume) < 1e-6F)
            return false;
        part = glm::clamp(part - glm::inverse(here.deformation) * miss, -beyond, 1 + beyond);
    }
    return false;
}

// A cell whose corners are seen around `g` may have it inside: tried from its middle, and from near its corners.
void Inverse::tryCell(glm::ivec3 cell, glm::vec3 g, Answer& best) const noexcept
{
    if (!seen(cell).holds(g))
        return;
    for (int start = -1; start < 8; ++start) {
        glm::vec3 part = start < 0 ? glm::vec3(0.5F) : 0.15F + 0.7F * glm::vec3(corner(start));
        float volume = 0;
        if (!solveInCell(cell, g, part, volume))
            continue;
        const glm::vec3 shift = glm::vec3(cell) + part - g;
        const float cost = glm::dot(shift, shift) + (volume > 0 ? 0.0F : 1e6F);
        if (best.cost < 0 || cost < best.cost)
            best = {shift, cost};
        if (volume > 0)
            return;
    }
}

// Visits the cells of which something may be seen in the box.
template <typename Visit>
void Inverse::forEachCellNear(const Box& place, Visit&& visit) const
{
    const glm::ivec3 low = glm::clamp(glm::ivec3(glm::floor(place.low - most_)) - 1, glm::ivec3(0), size_ - 2);
    const glm::ivec3 high = glm::clamp(glm::ivec3(glm::ceil(place.high - least_)), glm::ivec3(0), size_ - 2);
    for (int z = low.z; z <= high.z; ++z)
        for (int y = low.y; y <= high.y; ++y)
            for (int x = low.x; x <= high.x; ++x)
                visit(glm::ivec3(x, y, z));
}

Inverse::Answer Inverse::searched(glm::vec3 g) const noexcept
{
    Answer best;
    if (u_.empty() || size_.x < 2 || size_.y < 2 || size_.z < 2)
        return best;
    if (folded_.holds(g)) {
        const std::size_t b = bin(glm::clamp(glm::ivec3(glm::floor(g)) - binLow_, glm::ivec3(0), bins_ - 1));
        for (std::uint32_t i = first_[b]; i < first_[b + 1]; ++i)
            tryCell(base::cellOf(size_, cells_[i]), g, best);
        return best;
    }
    forEachCellNear({g, g}, [&](glm::ivec3 cell) { tryCell(cell, g, best); });
    return best;
}

void Inverse::checkCell(glm::ivec3 cell)
{
    if (!base::holds(size_ - 1, cell) || checked_[at(cell)] == updates_)
        return;
    checked_[at(cell)] = updates_;
    for (int k = 0; k < 8; ++k)
        if (glm::determinant(inCell(cell, glm::vec3(corner(k))).deformation) < flat) {
            const Box box = seen(cell);
            folded_.add(box.low);
            folded_.add(box.high);
            ++folds_;
            return;
        }
}

void Inverse::findFolds(std::span<const std::uint32_t> moved)
{
    const int row = size_.x, layer = row * size_.y;
    const auto squareOf = [](Lanes d) {
        d *= d;
        return d[0] + d[1] + d[2];
    };
    const float most = edgeWithout * edgeWithout / (perMetre_ * perMetre_);
    int begin = -row;  // of the row that the last node was in
    glm::ivec3 here(0);
    for (const std::uint32_t i : moved) {
        const auto n = static_cast<int>(i);
        if (n < begin || n >= begin + row) {
            begin = n - n % row;
            here = {0, begin / row % size_.y, begin / layer};
        }
        here.x = n - begin;
        const Lanes u = lanes(u_[i]);
        const auto changeTo = [&](bool there, int step) {
            return there ? squareOf(lanes(u_[static_cast<std::size_t>(n + step)]) - u) : 0.0F;
        };
        const float x = std::max(changeTo(here.x + 1 < size_.x, 1), changeTo(here.x > 0, -1));
        const float y = std::max(changeTo(here.y + 1 < size_.y, row), changeTo(here.y > 0, -row));
        const float z = std::max(changeTo(here.z + 1 < size_.z, layer), changeTo(here.z > 0, -layer));
        const bool steep = std::max({x, y, z}) > most;
        for (int k = 0; k < 8 && steep; ++k)
            checkCell(here - corner(k));
    }
}

// Cells by the unit cubes around folds that they are seen in.
void Inverse::indexCells()
{
    folded_.low -= close;
    folded_.high += close;
    binLow_ = glm::ivec3(glm::floor(folded_.low));
    bins_ = glm::ivec3(glm::floor(folded_.high)) - binLow_ + 1;
    const std::size_t all = bin({0, 0, bins_.z});
    if (all > mostBins) {
        folded_ = {};  // no tissue folds so widely: searched cell by cell
        return;
    }
    first_.assign(all + 2, 0);
    const auto visitBins = [&](auto&& visit) {
        forEachCellNear(folded_, [&](glm::ivec3 cell) {
            const Box box = seen(cell);
            const glm::ivec3 low = glm::max(glm::ivec3(glm::floor(box.low)) - binLow_, glm::ivec3(0));
            const glm::ivec3 high = glm::min(glm::ivec3(glm::floor(box.high)) - binLow_, bins_ - 1);
            for (int z = low.z; z <= high.z; ++z)
                for (int y = low.y; y <= high.y; ++y)
                    for (int x = low.x; x <= high.x; ++x)
                        visit(bin({x, y, z}), static_cast<std::uint32_t>(at(cell)));
        });
    };
    visitBins([&](std::size_t b, std::uint32_t) { ++first_[b + 2]; });
    for (std::size_t b = 2; b < first_.size(); ++b)
        first_[b] += first_[b - 1];
    cells_.resize(first_.back());
    visitBins([&](std::size_t b, std::uint32_t cell) { cells_[first_[b + 1]++] = cell; });
}

void Inverse::update(std::span<const glm::vec4> u, std::span<const std::uint32_t> moved)
{
    u_ = u;
    ++updates_;
    folds_ = 0;
    folded_ = {};
    least_ = most_ = glm::vec3(0);
    for (const std::uint32_t n : moved) {
        least_ = glm::min(least_, perMetre_ * glm::vec3(u[n]));
        most_ = glm::max(most_, perMetre_ * glm::vec3(u[n]));
    }
    findFolds(moved);
    if (folds_ > 0)
        indexCells();
}

}  // namespace palpate::channel
