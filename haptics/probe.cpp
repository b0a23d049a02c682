#include <haptics/probe.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::haptics {

namespace {

constexpr int looks = 128;  // along a needle

ultrasound::Beam beamOf(const datasets::ProbeSpec& spec)
{
    const auto transducer =
        spec.kind == datasets::ProbeKind::curved ? ultrasound::curvedProbe() : ultrasound::linearProbe();
    ultrasound::Settings settings = ultrasound::settingsOf(transducer);
    const auto take = [](double asked, float& value) { value = asked > 0.0 ? static_cast<float>(asked) : value; };
    take(spec.depth, settings.depth);
    take(spec.frequency, settings.frequency);
    take(spec.focus, settings.focus);
    return {transducer, settings};
}

}  // namespace

Probe::Probe(const datasets::ProbeSpec& spec) : spec_(spec)
{
    if (spec.kind != datasets::ProbeKind::none) {
        beam_ = beamOf(spec);
        count_ = beam_->curved() ? tools_.size() : 1;
    }
    at_ = datasets::probeAfter(spec_, {});
}

void Probe::place(const datasets::ProbeMove& move, const volume::DistanceField& surface) noexcept
{
    at_ = datasets::probeAfter(spec_, move);
    if (count_ == 0) {
        return;
    }
    const auto& transducer = beam_->transducer();
    const double half = 0.5 * static_cast<double>(beam_->curved() ? transducer.sector : transducer.width);
    // Middle of the edge's rounding, at l along the face.
    const auto bar = [&](double l) {
        const double radius = static_cast<double>(transducer.radius);
        return beam_->curved() ? at_.face - radius * at_.direction +
                                     (radius - edge) * (std::cos(l) * at_.direction + std::sin(l) * at_.lateral)
                               : at_.face - edge * at_.direction + l * at_.lateral;
    };
    for (std::size_t i = 0; i < count_; ++i) {
        const auto n = static_cast<double>(count_);
        const Vec3 from = bar(half * (2.0 * static_cast<double>(i) / n - 1.0));
        const Vec3 to = bar(half * (2.0 * static_cast<double>(i + 1) / n - 1.0));
        double depth = 0.0;
        for (const double t : {0.0, 0.25, 0.5, 0.75, 1.0}) {
            depth = std::max(depth, edge - surface.distance(from + t * (to - from)));
        }
        tools_[i].shape = {from, to, edge, edge};
        tools_[i].pushed = depth * at_.direction;
    }
}

double Probe::halfLength() const noexcept
{
    return beam_
               ? edge + (beam_->curved()
                             ? static_cast<double>(beam_->transducer().radius * std::sin(0.5F * beam_->transducer().sector))
                             : 0.5 * static_cast<double>(beam_->transducer().width))
               : 0.0;
}

bool Probe::sees(Vec3 p, double radius) const noexcept
{
    const Vec3 way = p - at_.face;
    const auto place =
        beam_->place(static_cast<float>(glm::dot(way, at_.lateral)), static_cast<float>(glm::dot(way, at_.direction)));
    const double across = glm::dot(way, glm::cross(at_.direction, at_.lateral));
    constexpr double halfAtHalf = 1.1774;  // half the width at half height of a Gaussian [sigma]
    return place.y >= 0.0F && place.y <= beam_->settings().depth &&
           std::abs(place.x) <= beam_->lineAt(static_cast<float>(beam_->settings().lines - 1)) &&
           std::abs(across) <= halfAtHalf * static_cast<double>(beam_->elevationSigma(place.y)) + radius;
}

NeedleInBeam Probe::look(Vec3 tip, Vec3 axis, double length, double radius) const noexcept
{
    if (!beam_ || length <= 0.0) {
        return {};
    }
    int seen = 0;
    for (int i = 0; i < looks; ++i) {
        seen += sees(tip - (i + 0.5) / looks * length * axis, radius) ? 1 : 0;
    }
    return {length * seen / looks, sees(tip, radius)};
}

}  // namespace palpate::haptics
