#include <ultrasound/rays.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::ultrasound {

constexpr float gelGap = 5e-3F;        // thicker gel has no contact [m]
constexpr float lobe = 0.25F;          // of a mirror echo that the aperture still gets [rad]
constexpr float shadowFill = 12e-6F;   // the square of a shadow edge's sigma grows by twice this a metre [m]
constexpr float steel = 5790;          // speed of sound [m/s]
constexpr float needleFall = 0.6F;     // [dB/degree]
constexpr float behindNeedle = 0.02F;  // amplitude that goes on
constexpr float tipEcho = 0.05F;       // of the bevel, seen from everywhere
constexpr float tipLength = 2e-3F;     // [m]
constexpr float gasContrast = -0.4F;   // of half ln Z: gas, not tissue, lies behind
constexpr float degree = 57.29578F;
// Between exact rest points, as the displacement is smooth:
constexpr int stride = 8;      // steps along a line
constexpr int lineStride = 4;  // lines

float needleEcho(float degrees) noexcept
{
    return 0.93F * std::pow(10.0F, -needleFall * degrees / 20);
}

float shareBetween(float low, float high, float sigma) noexcept
{
    constexpr float halfRoot = 0.70710678F;
    return 0.5F * (std::erf(halfRoot * high / sigma) - std::erf(halfRoot * low / sigma));
}

void RayCaster::prepare(const View& view)
{
    const Beam& beam = view.beam();
    step_ = beam.transducer().rayStep;
    sample_ = beam.sample();
    for (std::size_t label = 0; label < left_.size(); ++label) {
        const auto& s = view.medium().sound(static_cast<std::uint8_t>(label));
        const float centimetres = 100 * step_;
        left_[label] =
            std::pow(10.0F, -2 * s.attenuation * std::pow(beam.megahertz(), s.attenuationPower) * centimetres / 20);
        if ((label & compared) == 0 || label == unknown)
            left_[label] = 1;
    }
    const int planes = beam.settings().planes;
    planeWeight_.resize(static_cast<std::size_t>(planes));
    float all = 0;
    for (int e = 0; e < planes; ++e)
        all += planeWeight_[static_cast<std::size_t>(e)] = std::exp(-0.5F * beam.plane(e) * beam.plane(e));
    for (float& w : planeWeight_)
        w /= all;
}

void RayCaster::cast(const View& view, const Needle* needle, const RayOptions& options, Shade& shade, EchoLines& echoes)
{
    prepare(view);
    const Settings& settings = view.beam().settings();
    shade.planes = settings.planes;
    shade.lines = settings.lines;
    shade.steps = static_cast<int>(settings.depth / step_) + 1;
    shade.left.resize(shade.at(shade.planes, 0, 0));
    needle_.assign(static_cast<std::size_t>(settings.lines), {});
    for (int i = 0; needle != nullptr && i < settings.lines; ++i)
        needle_[static_cast<std::size_t>(i)] = meetNeedle(view.beam(), *needle, i);
    needleRadius_ = needle != nullptr ? needle->radius : 0.0F;
    for (int e = 0; e < settings.planes; ++e) {
        rest_.solve(view, settings.lines, lineStride, (shade.steps - 1) / stride + 2,
                    [&](int line, int row) { return pointAt(view.beam(), line, e, row); });
        for (int i = 0; i < settings.lines; ++i) {
            Ray ray;
            ray.line = i;
            ray.plane = e;
            ray.weight = planeWeight_[static_cast<std::size_t>(e)];
            ray.needle = needle_[static_cast<std::size_t>(i)];
            castLine(view, options, ray, shade, echoes);
        }
    }
    fillShadows(view, shade);
}

// Where the row of rest points `row` has its point of a line in a plane.
glm::vec3 RayCaster::pointAt(const Beam& beam, int line, int plane, int row) const
{
    const float z = static_cast<float>(row * stride) * step_;
    return beam.point(beam.lineAt(static_cast<float>(line)), beam.plane(plane) * beam.elevationSigma(z), z);
}

void RayCaster::deposit(EchoLines& echoes, int line, float depth, float re, float im) const
{
    const float f = depth / sample_ - 0.5F;
    const int k = static_cast<int>(std::floor(f));
    if (k < 0 || k + 1 >= echoes.samples)
        return;
    const float w = f - static_cast<float>(k);
    const std::size_t at = echoes.at(k, line), next = echoes.at(k + 1, line);
    echoes.re[at] += (1 - w) * re;
    echoes.re[next] += w * re;
    echoes.im[at] += (1 - w) * im;
    echoes.im[next] += w * im;
}

void RayCaster::castLine(const View& view, const RayOptions& options, Ray& ray, Shade& shade, EchoLines& echoes)
{
    const Medium& medium = view.medium();
    const auto restAt = [&](int row) {
        return rest_.voxel(view, pointAt(view.beam(), ray.line, ray.plane, row), ray.line, row);
    };
    glm::vec3 v(0), next = restAt(0);
    for (int s = 0; s < shade.steps; ++s) {
        const float z = static_cast<float>(s) * step_;
        if (s % stride == 0) {
            v = next;
            next = restAt(s / stride + 1);
            ray.step = (1.0F / stride) * (next - v);
        } else {
            v += ray.step;
        }
        const std::uint8_t label = medium.label(v);
        if ((label & compared) != 0) {
            ray.inside = ray.inside || label != unknown;
            ray.amplitude *= left_[label];
        } else if ((ray.inside || z > gelGap) && !ray.stopped && (label & pureBit) != 0) {
            stopAtAir(ray, z, echoes);
        }
        if (ray.needle.echo >= 0 && z >= ray.needle.at)
            echoNeedle(ray, echoes);
        if (ray.needle.tipAt >= 0 && z >= ray.needle.tipAt)
            deposit(echoes, ray.line, std::exchange(ray.needle.tipAt, -1.0F),
                    ray.weight * ray.amplitude * ray.needle.tipEcho, 0);
        if (options.interfaces && ((label & pureBit) == 0 || ray.crossing.weight > 0))
            cross(medium, v, label, z, ray, echoes);
        ray.last = label;
        shade.left[shade.at(ray.plane, s, ray.line)] = ray.amplitude * ray.behind;
    }
}

// Of ln Z the differences from point to point: over a border their sum is the whole change, wherever the points lie.
void RayCaster::cross(const Medium& medium, glm::vec3 v, std::uint8_t label, float depth, Ray& ray, EchoLines& echoes) const
{
    const bool pure = (label & pureBit) != 0;
    const Medium::Impedance here =
        pure ? Medium::Impedance{medium.pureImpedance(label), glm::vec3(0)} : medium.impedanceAt(v);
    const float before = (ray.last & pureBit) == 0 ? ray.lnZ : medium.pureImpedance(ray.last);
    const bool known = ray.last != unknown && label != unknown;
    const float change = known ? 0.5F * (here.ln - before) : 0.0F, size = std::abs(change);
    ray.lnZ = here.ln;
    if (change * ray.crossing.change < 0)
        release(ray, echoes);
    Crossing& c = ray.crossing;
    if (!(c.weight > 0))
        c.before = label;
    // What the second tissue takes comes after its border.
    if (!(c.weight > 0) || ((label ^ c.before) & compared) == 0)
        c.amplitude = ray.amplitude * ray.behind;
    c.change += change;
    c.weight += size;
    c.depth += size * (depth - 0.5F * step_);
    c.normal += here.slope;
    if (pure && c.weight > 0)
        release(ray, echoes);
}

// In quadrature by its sign: no phase can be had from voxels.
void RayCaster::release(Ray& ray, EchoLines& echoes) const
{
    const Crossing c = ray.crossing;
    ray.crossing = {};
    const float reflected = std::tanh(std::abs(c.change)), depth = c.depth / c.weight;
    const float lengths = glm::dot(c.normal, c.normal) * glm::dot(ray.step, ray.step);
    const float cosine = std::min(1.0F, std::abs(glm::dot(c.normal, ray.step)) / std::sqrt(lengths + 1e-20F));
    const float angle = std::acos(cosine);
    const float shape = 0.9F * std::exp(-angle * angle / (2 * lobe * lobe)) + 0.1F * cosine;
    float a = ray.weight * c.amplitude * reflected * shape;
    deposit(echoes, ray.line, depth, c.change > 0 ? a : 0, c.change > 0 ? 0 : a);
    // Gas: sound goes to and fro between it and the probe.
    constexpr int repeats = 3;
    constexpr float kept = 0.3F;
    for (int m = 2; c.change < gasContrast && m < 2 + repeats; ++m)
        deposit(echoes, ray.line, static_cast<float>(m) * depth, 0, a *= kept);
    ray.amplitude *= 1 - reflected * reflected;
}

// Out of the body into air, or without contact, where sound goes to and fro within the lens.
void RayCaster::stopAtAir(Ray& ray, float depth, EchoLines& echoes) const
{
    float a = 0.5F * ray.weight * ray.amplitude * ray.behind;
    if (ray.inside) {
        deposit(echoes, ray.line, depth, a, 0);
    } else {
        constexpr int repeats = 6;
        constexpr float apart = 0.7e-3F, kept = 0.4F;  // [m]
        for (int m = 1; m <= repeats; ++m, a *= kept)
            deposit(echoes, ray.line, static_cast<float>(m) * apart, a, 0);
    }
    ray.stopped = true;
    ray.amplitude = 0;
}

// Shaft and tip, as far as the beam of a line covers them.
RayCaster::NeedleHit RayCaster::meetNeedle(const Beam& beam, const Needle& needle, int line) const
{
    const std::vector<glm::vec3>& shape = needle.shape;
    NeedleHit hit;
    float way = 0;  // from the tip back to the piece
    for (std::size_t i = shape.size() - 1; i > 0; --i) {
        meetPiece(beam, needle, i, way, line, hit);
        way += glm::length(shape[i - 1] - shape[i]);
    }
    if (hit.echo >= 0) {
        const float covered = shareBetween(hit.low, hit.high, beam.elevationSigma(hit.at));
        hit.echo *= covered;
        hit.behind = 1 - (1 - behindNeedle) * covered;
    }
    const float l = beam.lineAt(static_cast<float>(line)), r = needle.radius;
    const glm::vec3 tip = shape.back(), d = beam.direction(l), w = tip - beam.point(l, tip.y, 0);
    const float depth = glm::dot(w, d);
    if (glm::dot(w, w) - depth * depth < r * r && depth > 0) {
        hit.tipAt = depth;
        hit.tipEcho = tipEcho * shareBetween(tip.y - r, tip.y + r, beam.elevationSigma(depth));
    }
    return hit;
}

// The part of a piece's middle line within a radius of the plane that line and elevation span. It covers the beam as far
// as the ellipse reaches that this plane cuts out of the cylinder; the depth is that of its upper side where it is nearest
// to the picture's plane.
void RayCaster::meetPiece(const Beam& beam, const Needle& needle, std::size_t piece, float way, int line,
                          NeedleHit& hit) const
{
    const glm::vec3 end = needle.shape[piece], axis = needle.shape[piece - 1] - end;
    const float length = glm::length(axis), l = beam.lineAt(static_cast<float>(line)), r = needle.radius;
    if (!(length > 1e-6F))
        return;
    const glm::vec3 d = beam.direction(l), u = axis / length, across(d.z, 0, -d.x);
    const float off = glm::dot(end - beam.point(l, 0, 0), across), slope = glm::dot(u, across);
    float first = 0, last = length;  // along the piece
    if (std::abs(slope) > 1e-6F) {
        first = std::clamp((-off - std::copysign(r, slope)) / slope, 0.0F, length);
        last = std::clamp((-off + std::copysign(r, slope)) / slope, 0.0F, length);
    }
    if (std::abs(off + slope * first) > 1.001F * r && std::abs(off + slope * last) > 1.001F * r)
        return;
    const float a = end.y + u.y * first, b = end.y + u.y * last, middle = 0.5F * (a + b);
    const float reach = std::hypot(r, 0.5F * (b - a)), nearest = std::clamp(0.0F, std::min(a, b), std::max(a, b));
    hit.low = std::min(hit.low, middle - reach);
    hit.high = std::max(hit.high, middle + reach);
    const glm::vec3 w = beam.point(l, nearest, 0) - end;
    const glm::vec3 dp = d - glm::dot(d, u) * u, wp = w - glm::dot(w, u) * u;
    const float square = glm::dot(dp, dp), half = glm::dot(wp, dp),
                root = half * half - square * (glm::dot(wp, wp) - r * r);
    const float t = root >= 0 && square > 1e-6F ? (-half - std::sqrt(root)) / square : -1;
    const float along = glm::dot(w + t * d, u);
    constexpr float alike = 0.1e-3F;  // off the plane [m]: then the upper one
    const float further = std::abs(nearest) - hit.off;
    if (t <= 0 || along < 0 || along > length || further > alike || (further > -alike && t >= hit.at))
        return;
    const float degrees = degree * std::asin(std::min(1.0F, std::abs(glm::dot(d, u))));
    hit.at = t;
    hit.off = std::abs(nearest);
    // The point spread dims what is oblique by itself: not twice.
    hit.echo = needleEcho(degrees) / dimmed(beam, t, std::tan(std::min(1.4F, degrees / degree)));
    if (way + along < tipLength)
        hit.echo += tipEcho * (1 - (way + along) / tipLength);
}

// What the point spread leaves of the peak of a line of echoes that goes down by `slope` metres a metre.
float RayCaster::dimmed(const Beam& beam, float depth, float slope) const
{
    constexpr int reach = 12;  // lines
    const float apart = beam.pitch() * beam.metresPerLine(depth);
    const float across = apart / beam.lateralSigma(depth), along = apart * slope / beam.axialSigma();
    float seen = 1, all = 1;
    for (int i = 1; i <= reach; ++i) {
        const auto n = static_cast<float>(i);
        const float w = 2 * std::exp(-0.5F * n * n * across * across);
        all += w;
        seen += w * std::exp(-0.5F * n * n * along * along);
    }
    return seen / all;
}

void RayCaster::echoNeedle(Ray& ray, EchoLines& echoes) const
{
    constexpr int repeats = 9;
    constexpr float first = 0.25F, kept = 0.6F;
    const float gap = 2 * needleRadius_ * soundSpeed / steel;  // between the walls, as it looks
    float a = ray.weight * ray.amplitude * ray.needle.echo;
    deposit(echoes, ray.line, ray.needle.at, a, 0);
    a *= first;
    for (int m = 1; m <= repeats; ++m, a *= kept) {
        const auto third = static_cast<std::uint32_t>(ray.line / 3), again = static_cast<std::uint32_t>(m);
        const float uneven = 0.7F + 0.6F * static_cast<float>(scrambled(third + 97 * again) & 255U) / 255;
        deposit(echoes, ray.line, ray.needle.at + static_cast<float>(m) * gap, a * uneven, 0);
    }
    ray.behind = ray.needle.behind;
    ray.needle.echo = -1;
}

// A shadow fills up with depth, for the aperture looks around an obstacle.
void RayCaster::fillShadows(const View& view, Shade& shade)
{
    const auto n = static_cast<std::size_t>(shade.lines);
    now_.resize(n);
    for (int e = 0; e < shade.planes; ++e) {
        before_.assign(n, 1);
        raw_.assign(n, 1);
        for (int s = 0; s < shade.steps; ++s) {
            float* a = &shade.left[shade.at(e, s, 0)];
            const float z = static_cast<float>(s) * step_;
            const float apart = view.beam().pitch() * view.beam().metresPerLine(z);
            const float fraction = std::min(0.25F, shadowFill * step_ / (apart * apart));
            now_[0] = a[0];
            now_[n - 1] = a[n - 1];
            for (std::size_t i = 1; i + 1 < n; ++i)
                now_[i] =
                    a[i] / (raw_[i] + 1e-9F) * (before_[i] + fraction * (before_[i - 1] - 2 * before_[i] + before_[i + 1]));
            std::copy_n(a, n, raw_.begin());
            std::copy_n(now_.begin(), n, a);
            std::swap(before_, now_);
        }
    }
}

}  // namespace palpate::ultrasound
