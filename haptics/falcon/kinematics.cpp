#include <haptics/falcon/kinematics.h>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::falcon {

namespace {

constexpr Geometry delta;
constexpr double radPerDegree = std::numbers::pi / 180.0;
constexpr int maxSteps = 40;          // of Newton's method
constexpr double converged = 1e-12;   // [m]
constexpr double longestStep = 0.03;  // of Newton's method [m]
constexpr double widestSide = 0.95;   // of the shin's way sideways, over its length

// Directions of a leg: outwards and along the tangent.
struct Frame {
    Vec3 radial, tangent;
};

Frame frameOf(std::size_t leg) noexcept
{
    const double bearing = delta.bearing[leg] * radPerDegree;
    const double c = std::cos(bearing), s = std::sin(bearing);
    return {{c, s, 0.0}, {-s, c, 0.0}};
}

// The grip's position as a leg sees it.
struct LegView {
    double across = 0, side = 0, height = 0;  // A, V, w [m]
    double shin = 0;                          // d + e + sqrt(b^2 - V^2) [m]
    double slope = 0;                         // of the shin's length over V
};

LegView viewOf(Vec3 position, const Frame& frame) noexcept
{
    LegView view;
    view.across = glm::dot(position, frame.radial) - delta.r + delta.c;
    view.side =
        std::clamp(glm::dot(position, frame.tangent) - delta.s + delta.f, -widestSide * delta.b, widestSide * delta.b);
    view.height = position.z;
    const double root = std::sqrt(delta.b * delta.b - view.side * view.side);
    view.shin = delta.d + delta.e + root;
    view.slope = -view.side / root;
    return view;
}

// How far the leg is from closing [m], and its derivatives.
struct Closure {
    double gap = 0;
    Vec3 byPosition{0.0};  // [-]
    double byAngle = 0;    // [m]
};

Closure closureOf(Vec3 position, double angle, std::size_t leg) noexcept
{
    const Frame frame = frameOf(leg);
    const LegView view = viewOf(position, frame);
    const double c = std::cos(angle), s = std::sin(angle);
    const double x = view.across - delta.a * c, z = view.height - delta.a * s;
    const double length = std::max(std::hypot(x, z), 1e-9);
    Closure closure;
    closure.gap = length - view.shin;
    closure.byPosition = (x / length) * frame.radial - view.slope * frame.tangent + Vec3(0.0, 0.0, z / length);
    closure.byAngle = delta.a * (x * s - z * c) / length;
    return closure;
}

struct System {
    glm::dmat3 rows{0};  // column i: gap i by position (so its transpose is the matrix of the equations)
    Vec3 gap{0.0}, byAngle{0.0};
};

System systemAt(Vec3 position, const Angles& angles) noexcept
{
    System system;
    for (std::size_t leg = 0; leg < 3; ++leg) {
        const Closure closure = closureOf(position, angles[leg], leg);
        const int i = static_cast<int>(leg);
        system.rows[i] = closure.byPosition;
        system.gap[i] = closure.gap;
        system.byAngle[i] = closure.byAngle;
    }
    return system;
}

// Shares of 1 that the directions' volume has of what three at right angles would.
double volumeOf(const glm::dmat3& rows) noexcept
{
    return std::abs(
        glm::determinant(glm::dmat3(glm::normalize(rows[0]), glm::normalize(rows[1]), glm::normalize(rows[2]))));
}

bool plausible(Vec3 p) noexcept
{
    return std::abs(p.x) < 0.2 && std::abs(p.y) < 0.2 && p.z > 0.0 && p.z < 0.25;
}

}  // namespace

std::optional<Vec3> positionAt(const Angles& angles, Vec3 near) noexcept
{
    Vec3 position = plausible(near) ? near : Vec3(0.0, 0.0, 0.13);
    for (int i = 0; i < maxSteps; ++i) {
        const System system = systemAt(position, angles);
        const glm::dmat3 matrix = glm::transpose(system.rows);
        if (!(std::abs(glm::determinant(matrix)) > 1e-6)) {
            return std::nullopt;
        }
        Vec3 step = -(glm::inverse(matrix) * system.gap);
        const double length = glm::length(step);
        if (!std::isfinite(length)) {
            return std::nullopt;
        }
        step *= std::min(1.0, longestStep / std::max(length, 1e-30));
        position += step;
        if (length < converged) {
            return plausible(position) ? std::optional(position) : std::nullopt;
        }
    }
    return std::nullopt;
}

std::optional<Posture> postureAt(const Angles& angles, Vec3 near) noexcept
{
    const auto position = positionAt(angles, near);
    if (!position) {
        return std::nullopt;
    }
    const System system = systemAt(*position, angles);
    const glm::dmat3 inverse = glm::inverse(glm::transpose(system.rows));
    Posture posture;
    posture.position = *position;
    posture.margin = volumeOf(system.rows);
    for (int i = 0; i < 3; ++i) {
        posture.jacobian[i] = -inverse[i] * system.byAngle[i];
        posture.margin = std::min(posture.margin, std::abs(system.byAngle[i]) / delta.a);
    }
    return posture;
}

Torques torquesFor(const Posture& posture, Vec3 force) noexcept
{
    return {glm::dot(posture.jacobian[0], force), glm::dot(posture.jacobian[1], force),
            glm::dot(posture.jacobian[2], force)};
}

Vec3 forceOf(const Posture& posture, const Torques& torques) noexcept
{
    return glm::inverse(glm::transpose(posture.jacobian)) * Vec3(torques[0], torques[1], torques[2]);
}

Angles anglesOf(const Triple& count) noexcept
{
    Angles angles{};
    for (std::size_t i = 0; i < 3; ++i) {
        angles[i] = zeroAngle + radPerCount * count[i];
    }
    return angles;
}

Triple motorCommand(const Torques& torques) noexcept
{
    double most = 0.0;
    for (const double t : torques) {
        if (!std::isfinite(t)) {
            return {};
        }
        most = std::max(most, std::abs(countsPerTorque * t));
    }
    const double scale = most > largestCommand ? largestCommand / most : 1.0;
    Triple motor{};
    for (std::size_t i = 0; i < 3; ++i) {
        motor[i] = static_cast<std::int16_t>(std::lround(-countsPerTorque * torques[i] * scale));
    }
    return motor;
}

Torques torquesOf(const Triple& motor) noexcept
{
    return {-motor[0] / countsPerTorque, -motor[1] / countsPerTorque, -motor[2] / countsPerTorque};
}

}  // namespace palpate::falcon
