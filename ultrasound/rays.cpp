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
    for (int e = 0; e < settings.planes; ++e) {
        rest_.solve(view, settings.lines, lineStride, (shade.steps - 1) / stride + 2,
                    [&](int line, int row) { return pointAt(view.beam(), line, e, row); });
        for (int i = 0; i < settings.lines; ++i) {
            Ray ray;
            ray.line = i;
            ray.plane = e;
            ray.weight = planeWeight_[static_cast<std::size_t>(e)];
            if (needle != nullptr) {
                needleRadius_ = needle->radius;
                meetNeedle(view, *needle, ray);
            }
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
        if (ray.needleEcho >= 0 && z >= ray.needleAt)
            echoNeedle(ray, echoes);
        if (ray.tipAt >= 0 && z >= ray.tipAt)
            deposit(echoes, ray.line, std::exchange(ray.tipAt, -1.0F), ray.weight * ray.amplitude * tipEcho, 0);
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

// The first of the shaft's pieces that the ray hits, and its tip.
void RayCaster::meetNeedle(const View& view, const Needle& needle, Ray& ray) const
{
    const Beam& beam = view.beam();
    const std::vector<glm::vec3>& shape = needle.shape;
    const float l = beam.lineAt(static_cast<float>(ray.line)), r = needle.radius;
    const glm::vec3 tip = shape.back(), d = beam.direction(l);
    const float y = beam.plane(ray.plane) * beam.elevationSigma(std::max(tip.z, 0.0F));
    const glm::vec3 from = beam.point(l, y, 0);
    ray.needleAt = 1e9F;
    float way = 0;  // from the tip back to the piece
    for (std::size_t i = shape.size() - 1; i > 0; --i) {
        const glm::vec3 axis = shape[i - 1] - shape[i];
        const float length = glm::length(axis);
        if (!(length > 1e-6F))
            continue;
        const glm::vec3 u = axis / length, w = from - shape[i];
        const glm::vec3 dp = d - glm::dot(d, u) * u, wp = w - glm::dot(w, u) * u;
        const float a = glm::dot(dp, dp), b = glm::dot(wp, dp), c = glm::dot(wp, wp) - r * r, root = b * b - a * c;
        const float t = root >= 0 && a > 1e-6F ? (-b - std::sqrt(root)) / a : -1;
        const float along = glm::dot(w + t * d, u);
        if (t > 0 && along >= 0 && along <= length && t < ray.needleAt) {
            const float degrees = degree * std::asin(std::min(1.0F, std::abs(glm::dot(d, u))));
            ray.needleAt = t;
            ray.needleEcho = needleEcho(degrees);
            // The point spread dims what is oblique by itself: not twice.
            ray.needleEcho /= dimmed(beam, t, std::tan(std::min(1.4F, degrees / degree)));
            if (way + along < tipLength)
                ray.needleEcho += tipEcho * (1 - (way + along) / tipLength);
        }
        way += length;
    }
    const glm::vec3 w = from - tip;
    const float b = glm::dot(w, d), off = glm::dot(w, w) - b * b;
    if (off < r * r && -b > 0)
        ray.tipAt = -b;
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
    float a = ray.weight * ray.amplitude * ray.needleEcho;
    deposit(echoes, ray.line, ray.needleAt, a, 0);
    a *= first;
    for (int m = 1; m <= repeats; ++m, a *= kept) {
        const auto third = static_cast<std::uint32_t>(ray.line / 3), again = static_cast<std::uint32_t>(m);
        const float uneven = 0.7F + 0.6F * static_cast<float>(scrambled(third + 97 * again) & 255U) / 255;
        deposit(echoes, ray.line, ray.needleAt + static_cast<float>(m) * gap, a * uneven, 0);
    }
    ray.behind = behindNeedle;
    ray.needleEcho = -1;
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
