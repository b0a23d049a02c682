#include <ultrasound/check_bodies.h>

#include <base/cells.h>

#include <algorithm>

namespace palpate::ultrasound {

namespace {

channel::Grid gridOver(glm::dvec3 size, double spacing)
{
    channel::Grid grid;
    for (int k = 0; k < 3; ++k)
        grid.size[static_cast<std::size_t>(k)] = static_cast<std::int32_t>(std::lround(size[k] / spacing)) + 1;
    grid.spacing = spacing;
    return grid;
}

glm::dvec3 nodeAt(const channel::Grid& grid, std::size_t i)
{
    return grid.spacing * glm::dvec3(base::cellOf(channel::sizeOf(grid), i));
}

std::vector<std::uint8_t> sampled(const channel::Grid& grid, const CheckBench::RowAt& rowAt)
{
    std::vector<std::uint8_t> rows(base::countOf(channel::sizeOf(grid)));
    for (std::size_t i = 0; i < rows.size(); ++i)
        rows[i] = rowAt(nodeAt(grid, i));
    return rows;
}

}  // namespace

CheckBench::CheckBench(const std::vector<channel::TissueSound>& tissues, double voxel, const RowAt& rowAt)
{
    const glm::dvec3 size(width, thickness, height);
    constexpr double lattice = 2e-3;
    std::copy(tissues.begin(), tissues.end(), scenery_.sound.begin() + 1);
    scenery_.sound[0] = {343, 100, 0, 0, -100, 0, 0};
    scenery_.tissues = static_cast<std::uint32_t>(tissues.size() + 1);
    scenery_.labels = scenery_.lattice = gridOver(size, lattice);
    scenery_.fine = gridOver(size, voxel);
    scenery_.tool = channel::ToolKind::needle;
    scenery_.toolRadius = 1.05e-3;
    scenery_.toolLength = 0.1;
    labels_ = sampled(scenery_.labels, rowAt);
    fine_ = sampled(scenery_.fine, rowAt);
    scanner_ = std::make_unique<Scanner>(scenery_, labels_, fine_);
    deformation_ = std::make_unique<channel::Deformation>(scenery_, labels_);
    pose = poseOf({0.5 * width, 0.5 * thickness, 3e-3}, {0, 0, 1}, {1, 0, 0});
    physics.variation = 0;
    physics.noise = -300;
}

void CheckBench::displace(const std::function<glm::dvec3(glm::dvec3)>& u)
{
    const auto out = std::make_unique<channel::Displaced>();
    const std::size_t nodes = base::countOf(channel::sizeOf(scenery_.lattice));
    for (std::size_t i = 0; i < std::min(nodes, channel::maxDisplaced); ++i) {
        const glm::dvec3 d = u(nodeAt(scenery_.lattice, i));
        out->nodes[i] = {static_cast<std::uint32_t>(i),
                         {static_cast<float>(d.x), static_cast<float>(d.y), static_cast<float>(d.z)}};
    }
    out->count = static_cast<std::uint32_t>(std::min(nodes, channel::maxDisplaced));
    deformation_->apply(*out);
}

void CheckBench::rest()
{
    deformation_->apply(*std::make_unique<channel::Displaced>());
}

void CheckBench::insert(glm::dvec3 tip, glm::dvec3 axis)
{
    state_.phase = channel::Phase::inserted;
    state_.tip = {tip.x, tip.y, tip.z};
    state_.axis = {axis.x, axis.y, axis.z};
    state_.inserted = scenery_.toolLength;
}

void CheckBench::scan()
{
    scanner_->setPhysics(physics);
    scanner_->scan(linearProbe(), settings, pose, *deformation_, state_, image);
    scanner_->power(envelope);
}

int CheckBench::line(double x) const
{
    return static_cast<int>(
        std::lround((x - pose.face.x) / static_cast<double>(beam().pitch()) + 0.5 * (settings.lines - 1)));
}

int CheckBench::sample(double z) const
{
    return static_cast<int>(std::lround((z - pose.face.z) / static_cast<double>(beam().sample()) - 0.5));
}

double CheckBench::in(const std::vector<float>& power, int sample, int line) const
{
    return static_cast<double>(power[static_cast<std::size_t>(sample * settings.lines + line)]);
}

double CheckBench::level(int fromSample, int toSample, int fromLine, int toLine) const
{
    double sum = 0;
    for (int k = fromSample; k < toSample; ++k)
        for (int i = fromLine; i < toLine; ++i)
            sum += power(k, i);
    return 10 * std::log10(sum / (toSample - fromSample) / (toLine - fromLine));
}

double decibels(double ratio)
{
    return 20 * std::log10(ratio);
}

double attenuationOf(const channel::TissueSound& sound)
{
    constexpr double megahertz = 9.0;
    return 2 * static_cast<double>(sound.attenuation) * std::pow(megahertz, static_cast<double>(sound.attenuationPower));
}

double reflectionOf(const channel::TissueSound& a, const channel::TissueSound& b)
{
    const double za = static_cast<double>(a.soundSpeed * a.density), zb = static_cast<double>(b.soundSpeed * b.density);
    return std::abs(zb - za) / (zb + za);
}

double correlation(const CheckBench& bench, int fromSample, int toSample, int fromLine, int toLine,
                   const std::function<double(int, int)>& other)
{
    double x = 0, y = 0, xx = 0, yy = 0, xy = 0, n = 0;
    for (int k = fromSample; k < toSample; ++k)
        for (int i = fromLine; i < toLine; ++i, ++n) {
            const double u = bench.power(k, i), v = other(k, i);
            x += u;
            y += v;
            xx += u * u;
            yy += v * v;
            xy += u * v;
        }
    return (xy - x * y / n) / std::sqrt((xx - x * x / n) * (yy - y * y / n));
}

}  // namespace palpate::ultrasound
