#include <ultrasound/scanner.h>

#include <base/fnv.h>
#include <base/processor_time.h>
#include <channel/needle_shape.h>

#include <algorithm>
#include <array>
#include <cstdint>

namespace palpate::ultrasound {

namespace {

// Padding of structs would be of chance: numbers one by one.
std::uint64_t hashOf(const channel::Scenery& scenery, std::span<const std::uint8_t> labels,
                     std::span<const std::uint8_t> fine)
{
    base::Fnv hash;
    for (const channel::Grid* grid : {&scenery.labels, &scenery.fine}) {
        hash.add(grid->size);
        hash.add(grid->origin);
        hash.add(grid->spacing);
    }
    for (std::uint32_t t = 0; t < scenery.tissues; ++t) {
        const channel::TissueSound& s = scenery.sound[t];
        hash.add(std::array{s.soundSpeed, s.density, s.attenuation, s.attenuationPower, s.echo, s.echoVariation});
        hash.add(s.pattern);
    }
    hash.addAll(labels);
    hash.addAll(fine);
    return std::max<std::uint64_t>(hash.value, 1);  // 0: not known
}

}  // namespace

Scanner::Scanner(const channel::Scenery& scenery, std::span<const std::uint8_t> labels, std::span<const std::uint8_t> fine)
    : scenery_(scenery), medium_(scenery, labels, fine), body_(hashOf(scenery, labels, fine))
{
}

void Scanner::setPhysics(const Physics& physics)
{
    physics_ = physics;
    scatterers_.setVariation(physics.variation);
}

Needle Scanner::needleIn(const View& view, const channel::State& state) const
{
    Needle needle;
    needle.radius = static_cast<float>(scenery_.toolRadius);
    const channel::NeedleShape shape = channel::needleShape(scenery_, state);
    std::transform(shape.begin(), shape.end(), std::back_inserter(needle.shape),
                   [&](glm::dvec3 p) { return view.local(p); });
    return needle;
}

void Scanner::scan(const Transducer& transducer, const Settings& settings, const Pose& pose,
                   const channel::Deformation& body, const channel::State& state, BeamImage& out)
{
    double last = base::processorTime();
    const auto lap = [&](Stage stage) {
        const double now = base::processorTime();
        seconds_[static_cast<std::size_t>(stage)] = now - last;
        last = now;
    };
    const Beam beam(transducer, settings);
    const View view(beam, pose, body, medium_);
    const std::size_t holes = std::min<std::size_t>(state.holes, channel::maxHoles);
    if (medium_.punch(std::span(state.hole).first(holes), scenery_.holeRadius))
        scatterers_.forget();
    echoes_.lines = beam.settings().lines;
    echoes_.samples = beam.settings().samples;
    echoes_.re.assign(echoes_.at(echoes_.samples, 0), 0);
    echoes_.im.assign(echoes_.at(echoes_.samples, 0), 0);
    const bool needled = scenery_.tool == channel::ToolKind::needle && state.phase == channel::Phase::inserted;
    const Needle needle = needled ? needleIn(view, state) : Needle{};
    rays_.cast(view, needled ? &needle : nullptr, {physics_.interfaces}, shade_, echoes_);
    spread_.addNoise(echoes_, physics_.noise, state.tick);
    lap(Stage::rays);
    if (physics_.speckle || !physics_.points.empty())
        scatterers_.find(view, medium_);
    lap(Stage::blocks);
    if (physics_.speckle)
        scatterers_.splat(view, shade_, echoes_);
    for (const PointTarget& p : physics_.points)
        scatterers_.splatPoint(view, shade_, view.local(body.seen(p.rest)), p.level, echoes_);
    lap(Stage::scatterers);
    spread_.axial(beam, echoes_);
    lap(Stage::axial);
    spread_.lateral(beam);
    lap(Stage::lateral);
    out.tick = state.tick;
    out.transducer = transducer;
    out.settings = beam.settings();
    out.pose = pose;
    out.body = body_;
    out.needled = needled;
    out.tip = channel::vec(state.tip);
    out.axis = channel::vec(state.axis);
    spread_.compress(beam, out.grey);
    lap(Stage::grey);
}

}  // namespace palpate::ultrasound
