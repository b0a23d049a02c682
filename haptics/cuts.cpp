#include <haptics/cuts.h>

#include <glm/geometric.hpp>

#include <cmath>

namespace palpate::haptics {

namespace {

constexpr double ends = 1e-9;     // by which a channel's ends count as inside [m]
constexpr int maxChannels = 16;   // that follow one another ahead of a tip
constexpr double minOpen = 1e-7;  // [m]

// How far the ray p + s axis stays inside, from p on; 0 when p is outside [m].
double exitOf(const Channel& c, Vec3 p, Vec3 axis) noexcept
{
    if (!c.contains(p)) {
        return 0.0;
    }
    const Vec3 w = p - c.from;
    const double place = glm::dot(w, c.along), pace = glm::dot(axis, c.along);
    double exit = 2.0 * (c.length + c.radius);
    if (pace > 0.0) {
        exit = std::min(exit, (c.length - place) / pace);
    } else if (pace < 0.0) {
        exit = std::min(exit, place / -pace);
    }
    const Vec3 across = w - place * c.along, turn = axis - pace * c.along;
    const double a = glm::dot(turn, turn);
    if (a > 1e-12) {
        const double b = glm::dot(across, turn);
        const double rest = c.radius * c.radius - glm::dot(across, across);
        exit = std::min(exit, (std::sqrt(std::max(b * b + a * rest, 0.0)) - b) / a);
    }
    return std::max(exit, 0.0);
}

}  // namespace

bool Channel::contains(Vec3 p) const noexcept
{
    const Vec3 w = p - from;
    const double place = glm::dot(w, along);
    return place >= -ends && place <= length + ends && glm::dot(w, w) - place * place <= radius * radius;
}

HolesNear::HolesNear(const Cuts& cuts, Vec3 middle, double radius) noexcept
{
    for (const Channel& c : cuts.cores.all()) {
        const Vec3 w = middle - c.from;
        const double place = glm::dot(w, c.along), reach = radius + c.radius;
        const bool near = place > -reach && place < c.length + reach && glm::dot(w, w) - place * place < reach * reach;
        if (near && count_ < most) {
            hole_[count_++] = &c;
        }
    }
}

bool HolesNear::contain(Vec3 rest) const noexcept
{
    return std::any_of(hole_.begin(), hole_.begin() + static_cast<std::ptrdiff_t>(count_),
                       [&](const Channel* c) { return c->contains(rest); });
}

bool taken(const Cuts& cuts, Vec3 rest) noexcept
{
    const auto all = cuts.cores.all();
    return std::any_of(all.begin(), all.end(), [&](const Channel& c) { return c.contains(rest); });
}

double openAhead(const Cuts& cuts, Vec3 p, Vec3 axis) noexcept
{
    double open = 0.0;
    for (int i = 0; i < maxChannels; ++i) {
        double further = 0.0;
        for (const auto& all : {cuts.paths.all(), cuts.cores.all()}) {
            for (const Channel& c : all) {
                further = std::max(further, exitOf(c, p + open * axis, axis));
            }
        }
        if (further < minOpen) {
            break;
        }
        open += further;
    }
    return open;
}

void cutPath(Cuts& cuts, Vec3 from, Vec3 to, double radius) noexcept
{
    const double step = glm::distance(from, to);
    if (step <= 0.0) {
        return;
    }
    if (Channel* c = cuts.paths.last()) {
        const Vec3 w = to - c->from;
        const double place = glm::dot(w, c->along);
        const double aside = std::sqrt(std::max(glm::dot(w, w) - place * place, 0.0));
        const bool atItsEnd = std::abs(glm::dot(from - c->from, c->along) - c->length) <= radius;
        if (atItsEnd && place > 0.0 && aside <= 0.25 * radius) {
            c->length = std::max(c->length, place);
            return;
        }
    }
    // It reaches back into what is open already, so that no film is left between the two.
    const Vec3 along = (to - from) / step;
    cuts.paths.add({from - radius * along, along, step + radius, radius});
}

}  // namespace palpate::haptics
