#include <studies/kernel/kernel_trial.h>

#include <base/error.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <unordered_map>

namespace palpate::studies {

namespace {

constexpr double minForce = 0.05;  // fraction of the path's peak
constexpr double samePose = 1e-8;  // another machine may round the path otherwise [m]

// The shortest way along x between two positions of one line.
double latticeStep(std::span<const Vec3f> position)
{
    constexpr double shortest = 1e-5, sameLine = 1e-6;  // [m]
    double step = 0.0;
    for (std::size_t i = 1; i < position.size(); ++i) {
        const Vec3 way = glm::abs(Vec3(position[i]) - Vec3(position[i - 1]));
        const bool onLine = std::max(way.y, way.z) < sameLine && way.x > shortest;
        step = onLine && (step == 0.0 || way.x < step) ? way.x : step;
    }
    return step;
}

std::uint64_t cellKey(Index3 n)
{
    constexpr int offset = 1 << 20;
    const auto part = [](int i) { return static_cast<std::uint64_t>(i + offset); };
    return part(n.x) << 42U | part(n.y) << 21U | part(n.z);
}

std::array<Vec3, 8> atCorners(std::span<const Vec3> u, const std::array<std::uint32_t, 8>& corners)
{
    std::array<Vec3, 8> out;
    std::ranges::transform(corners, out.begin(), [&](std::uint32_t c) { return u[c]; });
    return out;
}

// How much larger a cell has become: the determinant of I + the mean gradient of u in it.
double jacobian(std::span<const Vec3> u, const std::array<std::uint32_t, 8>& corners, double side)
{
    return glm::determinant(Mat3(1.0) + meanGradient(atCorners(u, corners), side));
}

double volumeError(std::span<const Vec3> u, const Reference& reference, const PositionCells& cells,
                   const ReferenceState& state)
{
    const std::vector<Vec3> wanted(state.u.begin(), state.u.end());
    double sum = 0.0;
    std::size_t count = 0;
    for (const auto& corners : cells.corners) {
        const Vec3 middle = 0.5 * (Vec3(reference.position[corners[0]]) + Vec3(reference.position[corners[7]]));
        if (glm::distance(middle, state.focus) < nearField) {
            sum += std::abs(jacobian(u, corners, cells.side) - jacobian(wanted, corners, cells.side));
            ++count;
        }
    }
    return 100.0 * sum / static_cast<double>(std::max<std::size_t>(count, 1));
}

}  // namespace

Mat3 meanGradient(const std::array<Vec3, 8>& u, double side)
{
    Mat3 gradient(0.0);
    for (int c = 0; c < 8; ++c) {
        const Vec3 corner(c & 1, (c >> 1) & 1, c >> 2);
        gradient += glm::outerProduct(u[static_cast<std::size_t>(c)], (2.0 * corner - 1.0) / (4.0 * side));
    }
    return gradient;
}

double equivalentStrain(const Mat3& gradient)
{
    double sum = 0.0;
    const Mat3 strain = 0.5 * (gradient + glm::transpose(gradient));
    for (int i = 0; i < 3; ++i) {
        sum += glm::dot(strain[i], strain[i]);
    }
    return std::sqrt(2.0 / 3.0 * sum);
}

double exceededStrain(std::vector<double> strains, double side)
{
    constexpr double strainedVolume = 1e-7;  // [m^3]
    const auto beyond = static_cast<std::size_t>(strainedVolume / (side * side * side));
    if (strains.size() <= beyond) {
        return 0.0;
    }
    const auto at = strains.begin() + static_cast<std::ptrdiff_t>(beyond);
    std::nth_element(strains.begin(), at, strains.end(), std::greater<>());
    return *at;
}

PositionCells positionCells(std::span<const Vec3f> position)
{
    PositionCells cells;
    cells.side = latticeStep(position);
    if (cells.side == 0.0) {
        return cells;
    }
    const auto placeOf = [&](Vec3f p) { return (Vec3(p) - Vec3(position[0])) / cells.side; };
    const auto indexOf = [&](Vec3f p) { return Index3(glm::round(placeOf(p))); };
    std::unordered_map<std::uint64_t, std::uint32_t> found;
    for (std::size_t i = 0; i < position.size(); ++i) {
        constexpr double onLattice = 0.01;
        if (glm::distance(placeOf(position[i]), Vec3(indexOf(position[i]))) < onLattice) {
            found.emplace(cellKey(indexOf(position[i])), static_cast<std::uint32_t>(i));
        }
    }
    for (const Vec3f& p : position) {
        std::array<std::uint32_t, 8> corners{};
        bool whole = true;
        for (int c = 0; c < 8 && whole; ++c) {
            const auto at = found.find(cellKey(indexOf(p) + Index3(c & 1, (c >> 1) & 1, c >> 2)));
            whole = at != found.end();
            corners[static_cast<std::size_t>(c)] = whole ? at->second : 0;
        }
        if (whole) {
            cells.corners.push_back(corners);
        }
    }
    return cells;
}

TrialErrors errorsOf(std::span<const Vec3> u, const std::optional<Vec3>& force, const Reference& reference,
                     const PositionCells& cells, const ReferenceState& state)
{
    TrialErrors errors;
    double all = 0.0, near = 0.0, worst = 0.0;
    std::size_t nearCount = 0;
    for (std::size_t i = 0; i < state.u.size(); ++i) {
        const Vec3 off = u[i] - Vec3(state.u[i]);
        const double square = glm::dot(off, off);
        all += square;
        worst = std::isnan(square) || square > worst ? square : worst;
        if (glm::distance(Vec3(reference.position[i]), state.focus) < nearField) {
            near += square;
            ++nearCount;
        }
    }
    const double percent = state.largest > 0.0 ? 100.0 / state.largest : 0.0;
    errors.rms = percent * std::sqrt(all / static_cast<double>(std::max<std::size_t>(state.u.size(), 1)));
    errors.near = percent * std::sqrt(near / static_cast<double>(std::max<std::size_t>(nearCount, 1)));
    errors.max = percent * std::sqrt(worst);
    errors.volume = volumeError(u, reference, cells, state);
    const double scale = std::max(glm::length(state.force), minForce * reference.peakForce);
    if (force && scale > 0.0) {
        errors.force = 100.0 * glm::distance(*force, state.force) / scale;
    }
    return errors;
}

const ReferenceState& stateAt(const Reference& reference, TrialPose pose)
{
    for (const ReferenceState& s : reference.states) {
        if (std::abs(s.pose.pressed - pose.pressed) < samePose && std::abs(s.pose.dragged - pose.dragged) < samePose) {
            return s;
        }
    }
    throw std::logic_error("trial: the reference was solved for other speeds");
}

std::vector<TrialErrors> errorsBetween(const Reference& model, const Reference& reference, const TrialPath& path,
                                       double speed)
{
    base::failIf(model.position != reference.position,
                 "references with {} and {} positions that are not the same cannot be compared: make both anew",
                 model.position.size(), reference.position.size());
    const PositionCells cells = positionCells(reference.position);
    std::vector<TrialErrors> out;
    for (const TrialTick& t : schedule(path, speed)) {
        if (t.look) {
            const ReferenceState& now = stateAt(model, t.pose);
            const std::vector<Vec3> u(now.u.begin(), now.u.end());
            out.push_back(errorsOf(u, now.force, reference, cells, stateAt(reference, t.pose)));
            out.back().phase = t.phase;
        }
    }
    return out;
}

}  // namespace palpate::studies
