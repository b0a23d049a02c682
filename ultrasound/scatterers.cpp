#include <ultrasound/scatterers.h>

#include <base/cells.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include <cmath>
#include <cstring>

namespace palpate::ultrasound {

namespace {

constexpr std::size_t patterns = 256;
constexpr float reach = 2.1F;  // across the picture's plane [sigmas]
constexpr float millimetre = 1e3F;
constexpr int brickSide = 8;  // [blocks]
constexpr std::size_t perBrick = std::size_t{brickSide} * brickSide * brickSide;
constexpr std::size_t mostBricks = 4096;  // 78 MB; a picture has a hundred or a few

float uniform(std::uint32_t& state) noexcept
{
    state = scrambled(state + 1);
    return static_cast<float>(state) / 4294967296.0F;
}

// Smooth noise in about [-1, 1] with a period of one.
float wave(glm::vec3 x) noexcept
{
    const glm::ivec3 n(glm::floor(x));
    glm::vec3 t = x - glm::vec3(n);
    t = t * t * (3.0F - 2.0F * t);
    float sum = 0;
    for (int m = 0; m < 8; ++m) {
        const glm::ivec3 c = n + glm::ivec3(m & 1, m >> 1 & 1, m >> 2);
        const std::uint32_t h =
            scrambled(static_cast<std::uint32_t>(c.x) * 73856093U ^ static_cast<std::uint32_t>(c.y) * 19349663U ^
                      static_cast<std::uint32_t>(c.z) * 83492791U);
        const float w = ((m & 1) != 0 ? t.x : 1 - t.x) * ((m & 2) != 0 ? t.y : 1 - t.y) * ((m & 4) != 0 ? t.z : 1 - t.z);
        sum += w * (static_cast<float>(h) / 2147483648.0F - 1);
    }
    return 1.4F * sum;
}

// In [-1, 1] about: what part of its variation a tissue's echo has at `p` [mm].
float variationAt(std::uint32_t pattern, glm::vec3 p) noexcept
{
    switch (pattern) {
        case 1:  // lobules in stroma
            return 0.55F * wave(1.1F * p) + 0.45F * wave(0.45F * p);
        case 2:  // fibres
            return wave(p * glm::vec3(0.35F, 1.6F, 0.35F));
        case 3: {  // septa between lobules
            constexpr float thin = 0.03F;
            return 0.3F * wave(0.8F * p) + (std::abs(wave(0.33F * p + 9.0F)) < thin ? 1.0F : 0.0F);
        }
        default:
            return wave(0.7F * p);
    }
}

}  // namespace

Scatterers::Scatterers() : patterns_(patterns)
{
    std::uint32_t state = 1;
    // A low-discrepancy sequence (R3 of Roberts), each point shaken by a quarter of a block.
    const auto placed = [&](float at) {
        at += 0.25F * (uniform(state) - 0.5F);
        return at - std::floor(at) - 0.5F;
    };
    for (Pattern& q : patterns_) {
        const float u = uniform(state), v = uniform(state), w = uniform(state);
        for (std::size_t j = 0; j < perBlock; ++j) {
            const auto n = static_cast<float>(j);
            q.x[j] = placed(u + n * 0.8191725134F);
            q.y[j] = placed(v + n * 0.6710436067F);
            q.z[j] = placed(w + n * 0.5497004779F);
        }
    }
    for (std::size_t c = 1; c < level_.size(); ++c)
        level_[c] = std::pow(10.0F, (fatEcho + 0.5F * (static_cast<float>(c) - 128)) / 20);
}

void Scatterers::setVariation(float fraction)
{
    variation_ = fraction;
    forget();
}

// N scatterers of amplitude a under the three Gaussians of the point spread give an rms of a sqrt(N).
void Scatterers::prepare(const View& view, const Medium& medium)
{
    const Beam& beam = view.beam();
    const float edge = beam.transducer().block;
    if (edge != edge_) {
        edge_ = edge;
        voxelsPerBlock_ = edge / static_cast<float>(medium.spacing());
        first_ = glm::ivec3(glm::floor(glm::vec3(medium.low()) / voxelsPerBlock_));
        size_ = glm::ivec3(glm::vec3(medium.high()) / voxelsPerBlock_) + 1 - first_;
        bricks_ = (size_ + (brickSide - 1)) / brickSide;
        brickAt_.clear();
    }
    if (brickAt_.empty() || block_.size() > mostBricks * perBrick) {
        brickAt_.assign(base::countOf(bricks_), 0);
        stamp_.clear();
        known_.clear();
        block_.clear();
    }
    const float density = perBlock / (edge * edge * edge);
    constexpr float rootPi = 1.7724539F;
    norm_.resize(static_cast<std::size_t>(beam.settings().samples));
    for (std::size_t k = 0; k < norm_.size(); ++k) {
        const float z = (static_cast<float>(k) + 0.5F) * beam.sample(), apart = beam.pitch() * beam.metresPerLine(z);
        // The cut at `reach` and the bilinear splat take a little: measured, 0.75 dB.
        constexpr float lost = 1.09F;
        norm_[k] = lost / std::sqrt(density * rootPi * beam.axialSigma() * apart * apart /
                                    (2 * rootPi * beam.lateralSigma(z)) * rootPi * beam.elevationSigma(z));
    }
}

// By looks at the slice half a block apart.
void Scatterers::find(const View& view, const Medium& medium)
{
    prepare(view, medium);
    const Beam& beam = view.beam();
    chosen_.clear();
    ++pass_;
    const float half = beam.halfWidth() + edge_, apart = 0.5F * edge_, depth = beam.settings().depth + edge_;
    for (float z = beam.top() - edge_; z < depth; z += apart) {
        const float farthest = beam.place(half, z).y;  // along a line, as the lens has it
        const float wide = reach * std::max(beam.elevationSigma(z), beam.elevationSigma(farthest)) + 0.4F * edge_;
        const int steps = static_cast<int>(std::ceil(wide / apart));
        float from = -half, to = half;
        while (from < to && !nearPicture(beam, from, z))
            from += apart;
        while (to > from && !nearPicture(beam, to, z))
            to -= apart;
        const int looks = static_cast<int>(std::ceil((to - from) / apart));
        for (int j = -steps; looks > 0 && j <= steps; ++j)
            findAlong(view, {from, static_cast<float>(j) * wide / static_cast<float>(steps), z}, looks);
    }
}

bool Scatterers::nearPicture(const Beam& beam, float l, float z) const
{
    if (!beam.curved())
        return true;
    const glm::vec2 at = beam.place(l, z);
    return at.y >= -edge_ && at.y <= beam.settings().depth + edge_ &&
           std::abs(at.x) <= 0.5F * beam.transducer().sector + edge_ / beam.transducer().radius;
}

// Chooses the blocks that lie along a row of `looks` points from `first`.
void Scatterers::findAlong(const View& view, glm::vec3 first, int looks)
{
    constexpr int stride = 4;  // looks between exact rest points: two blocks
    const float perBlockVoxel = 1 / voxelsPerBlock_, apart = 0.5F * edge_;
    const auto pointAt = [&](int look) { return first + glm::vec3(static_cast<float>(look) * apart, 0, 0); };
    rest_.solve(view, looks, stride, 1, [&](int look, int) { return pointAt(look); });
    for (int i = 0; i < looks; ++i) {
        const glm::vec3 p = pointAt(i);
        if (!nearPicture(view.beam(), p.x, p.z))
            continue;
        const glm::ivec3 n = glm::ivec3(glm::floor(perBlockVoxel * rest_.voxel(view, p, i, 0))) - first_;
        if (!base::holds(size_, n))
            continue;
        const std::uint32_t kept = keptAt(n);
        if (stamp_[kept] == pass_)
            continue;
        stamp_[kept] = pass_;
        chosen_.push_back({static_cast<std::uint32_t>(base::offsetOf(size_, n)), kept});
    }
}

// Where a block of the body is kept; makes its brick.
std::uint32_t Scatterers::keptAt(glm::ivec3 n)
{
    std::uint32_t& brick = brickAt_[base::offsetOf(bricks_, n / brickSide)];
    if (brick == 0) {
        const std::size_t count = block_.size() + perBrick;
        stamp_.resize(count, pass_ - 1);
        known_.resize(count, Known::no);
        block_.resize(count);
        brick = static_cast<std::uint32_t>(count / perBrick);
    }
    const auto inside = static_cast<std::uint32_t>(base::offsetOf(glm::ivec3(brickSide), n % brickSide));
    return (brick - 1) * static_cast<std::uint32_t>(perBrick) + inside;
}

// [voxels]
glm::vec3 Scatterers::cornerOf(std::uint32_t id) const
{
    return voxelsPerBlock_ * glm::vec3(base::cellOf(size_, id) + first_);
}

std::size_t Scatterers::memory() const noexcept
{
    return sizeof(std::uint32_t) * (brickAt_.capacity() + stamp_.capacity()) + sizeof(Known) * known_.capacity() +
           sizeof(Block) * block_.capacity();
}

// What each scatterer of a block sends back: its tissue, and the variation within that; once a block.
void Scatterers::fill(const Chosen& chosen, glm::vec3 corner, const Medium& medium)
{
    const Pattern& q = patterns_[scrambled(chosen.id) % patterns];
    const float perVoxel = millimetre * static_cast<float>(medium.spacing());
    bool any = false;
    for (std::size_t j = 0; j < perBlock; ++j) {
        const glm::vec3 v = corner + voxelsPerBlock_ * (glm::vec3(q.x[j], q.y[j], q.z[j]) + 0.5F);
        const std::uint8_t label = medium.label(v);
        std::uint8_t& strength = block_[chosen.kept].strength[j];
        strength = 0;
        if ((label & compared) == 0 || label == unknown)
            continue;
        const channel::TissueSound& s = medium.sound(label);
        const float vary = variation_ > 0 ? variation_ * s.echoVariation * variationAt(s.pattern, perVoxel * v) : 0.0F;
        const float dB = s.echo + vary;
        constexpr float faintest = -60;
        if (dB > faintest) {
            strength = static_cast<std::uint8_t>(std::clamp(static_cast<int>(std::lround(2 * dB)) + 128, 1, 255));
            any = true;
        }
    }
    known_[chosen.kept] = any ? Known::some : Known::nothing;
}

// Moves a block: its middle by u, its inside by F.
void Scatterers::place(const View& view, glm::vec3 corner, const Pattern& q, BlockEchoes& out, float& depth,
                       float& off) const
{
    const Medium& medium = view.medium();
    const channel::Deformation& body = view.body();
    const glm::dvec3 rest = medium.origin() + medium.spacing() * glm::dvec3(corner + 0.5F * voxelsPerBlock_);
    glm::dvec3 middle = rest;
    glm::mat3 f(edge_);
    if (!view.still()) {
        const double spacing = body.lattice().spacing;
        const glm::vec3 g((rest - channel::vec(body.lattice().origin)) / spacing);
        middle += glm::dvec3(body.displacement(g));
        const float h = 0.5F * edge_ / static_cast<float>(spacing);
        for (int axis = 0; axis < 3; ++axis) {
            glm::vec3 e(0);
            e[axis] = h;
            f[axis] += body.displacement(g + e) - body.displacement(g - e);
        }
    }
    const glm::vec3 m = view.local(middle);
    const glm::vec3 x = view.inward(f[0]), y = view.inward(f[1]), z = view.inward(f[2]);
    for (std::size_t j = 0; j < perBlock; ++j) {
        out.l[j] = m.x + x.x * q.x[j] + y.x * q.y[j] + z.x * q.z[j];
        out.y[j] = m.y + x.y * q.x[j] + y.y * q.y[j] + z.y * q.z[j];
        out.z[j] = m.z + x.z * q.x[j] + y.z * q.y[j] + z.z * q.z[j];
    }
    depth = view.beam().place(m.x, m.z).y;
    off = m.y;
}

BlockScale Scatterers::scaleAt(const View& view, float depth) const
{
    const Beam& beam = view.beam();
    const float sigma = beam.elevationSigma(depth);
    BlockScale s;
    s.radius = beam.curved() ? beam.transducer().radius : 0.0F;
    s.turns = 2 / beam.wavelength();
    s.perLine = 1 / beam.pitch();
    s.middle = 0.5F * static_cast<float>(beam.settings().lines - 1);
    s.perSample = 1 / beam.sample();
    s.elevation = 1 / (32 * sigma * sigma);
    s.cut = reach * sigma;
    s.planes = static_cast<float>(beam.settings().planes - 1) / (2 * planeReach * sigma);
    return s;
}

void Scatterers::Sum::clear(int lineCount, int sampleCount)
{
    lines = lineCount;
    samples = sampleCount;
    complex.assign(2 * static_cast<std::size_t>(lines) * static_cast<std::size_t>(samples), 0);
}

void Scatterers::Sum::add(int sample, int line, float part, Lanes echo) noexcept
{
    const auto to = [](float* p, Lanes more) {
        Lanes q;
        std::memcpy(&q, p, sizeof q);
        q += more;
        std::memcpy(p, &q, sizeof q);
    };
    const std::size_t row = 2 * static_cast<std::size_t>(lines);
    float* first = &complex[static_cast<std::size_t>(sample) * row + 2 * static_cast<std::size_t>(line)];
    to(first, (1 - part) * echo);
    to(first + row, part * echo);
}

void Scatterers::Sum::addTo(EchoLines& echoes) const
{
    for (std::size_t i = 0; i < echoes.re.size(); ++i) {
        echoes.re[i] += complex[2 * i];
        echoes.im[i] += complex[2 * i + 1];
    }
}

void Scatterers::add(const View& view, const Shade& shade, const Block& block, const BlockEchoes& at)
{
    const float toStep = view.beam().sample() / view.beam().transducer().rayStep;
    const int centre = shade.planes / 2;
    const auto lines = static_cast<float>(sum_.lines - 1), samples = static_cast<float>(sum_.samples - 1);
    for (std::size_t j = 0; j < perBlock; ++j) {
        const float l = at.l[j], z = at.z[j];
        const bool beside = at.cosine[j] == 0 && at.sine[j] == 0;  // too far from the picture's plane
        if (block.strength[j] == 0 || beside || !(l >= 0 && z >= 0 && l < lines && z < samples))
            continue;
        const int i = static_cast<int>(l), k = static_cast<int>(z);
        const int plane = std::clamp(static_cast<int>(at.y[j]) + centre, 0, shade.planes - 1);
        const int step = std::min(static_cast<int>((z + 0.5F) * toStep), shade.steps - 1);
        const float left = shade.left[shade.at(plane, step, static_cast<int>(l + 0.5F))];
        const float a = left * level_[block.strength[j]] * norm_[static_cast<std::size_t>(k)];
        const float wl = l - static_cast<float>(i), wz = z - static_cast<float>(k);
        const float c = a * at.cosine[j], s = a * at.sine[j];
        sum_.add(k, i, wz, Sum::Lanes{(1 - wl) * c, (1 - wl) * s, wl * c, wl * s});
    }
}

void Scatterers::splat(const View& view, const Shade& shade, EchoLines& echoes)
{
    const Kernels& k = kernels();
    sum_.clear(echoes.lines, echoes.samples);
    BlockEchoes at;
    for (const Chosen& chosen : chosen_) {
        Known& known = known_[chosen.kept];
        if (known == Known::nothing)
            continue;
        const glm::vec3 corner = cornerOf(chosen.id);
        if (known == Known::no)
            fill(chosen, corner, view.medium());
        if (known == Known::nothing)
            continue;
        float depth = 0, off = 0;
        place(view, corner, patterns_[scrambled(chosen.id) % patterns], at, depth, off);
        const BlockScale scale = scaleAt(view, depth);
        if (std::abs(off) > scale.cut + edge_)
            continue;
        k.echoes(scale, at);
        add(view, shade, block_[chosen.kept], at);
    }
    sum_.addTo(echoes);
}

void Scatterers::splatPoint(const View& view, const Shade& shade, glm::vec3 p, float level, EchoLines& echoes)
{
    BlockEchoes at{};
    at.l[0] = p.x;
    at.y[0] = p.y;
    at.z[0] = p.z;
    Block block{};
    block.strength[0] = static_cast<std::uint8_t>(std::clamp(static_cast<int>(std::lround(2 * level)) + 128, 1, 255));
    kernels().echoes(scaleAt(view, view.beam().place(p.x, p.z).y), at);
    sum_.clear(echoes.lines, echoes.samples);
    add(view, shade, block, at);
    sum_.addTo(echoes);
}

}  // namespace palpate::ultrasound
