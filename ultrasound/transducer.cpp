#include <ultrasound/transducer.h>

#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::ultrasound {

constexpr float perSigma = 2.3548F;  // width at half height of a Gaussian
constexpr float pulse = 0.4413F;     // 2 ln 2 / pi

Transducer linearProbe()
{
    return {};
}

Transducer curvedProbe()
{
    Transducer t;
    t.shape = ProbeShape::curved;
    t.frequency = 3.5e6F;
    t.lowest = 2e6F;
    t.highest = 6e6F;
    t.bandwidth = 0.6F;
    t.elevationWidth = 3e-3F;
    t.elevationFocus = 70e-3F;
    t.elevationRange = 40e-3F;
    t.depth = 140e-3F;
    t.shallowest = 60e-3F;
    t.deepest = 200e-3F;
    t.focus = 75e-3F;
    t.compensation = 1.11F;
    t.baseGain = 70;
    t.rayStep = 0.25e-3F;
    t.block = 2e-3F;
    return t;
}

Settings settingsOf(const Transducer& transducer)
{
    Settings s;
    s.depth = transducer.depth;
    s.frequency = transducer.frequency;
    s.focus = transducer.focus;
    return s;
}

Settings within(Settings s, const Transducer& transducer)
{
    s.depth = std::clamp(s.depth, transducer.shallowest, transducer.deepest);
    s.frequency = std::clamp(s.frequency, transducer.lowest, transducer.highest);
    s.focus = std::clamp(s.focus, 0.1F * s.depth, s.depth);
    s.gain = std::clamp(s.gain, -40.0F, 40.0F);
    s.dynamicRange = std::clamp(s.dynamicRange, 30.0F, 100.0F);
    for (float& slider : s.tgc)
        slider = std::clamp(slider, -20.0F, 20.0F);
    s.lines = std::clamp(s.lines, 32, 512);
    s.samples = std::clamp(s.samples, 128, 4096);
    s.planes = std::clamp(s.planes, 1, 9);
    return s;
}

Pose poseOf(glm::dvec3 face, glm::dvec3 axial, glm::dvec3 lateral)
{
    Pose pose;
    pose.face = face;
    pose.axial = glm::normalize(axial);
    pose.lateral = glm::normalize(lateral - glm::dot(lateral, pose.axial) * pose.axial);
    pose.elevation = glm::cross(pose.axial, pose.lateral);
    return pose;
}

Beam::Beam(const Transducer& transducer, const Settings& settings)
    : transducer_(transducer),
      settings_(within(settings, transducer)),
      wavelength_(soundSpeed / settings_.frequency),
      axialSigma_(pulse * soundSpeed / (transducer.bandwidth * settings_.frequency) / perSigma),
      pitch_((transducer.shape == ProbeShape::curved ? transducer.sector : transducer.width) /
             static_cast<float>(settings_.lines - 1)),
      sample_(settings_.depth / static_cast<float>(settings_.samples))
{
}

float Beam::lateralSigma(float z) const noexcept
{
    const float f = transducer_.fNumber, w0 = 0.886F * wavelength_ * f, w1 = 1.4142136F * w0;
    const float q = (z - settings_.focus) / (3.5F * wavelength_ * f * f);
    return std::sqrt(1 / (1 / (w1 * w1 * (1 + q * q)) + 1 / (w1 * w1))) / perSigma;
}

// The lens's width goes with the wavelength.
float Beam::elevationSigma(float z) const noexcept
{
    const float q = (std::max(z, 0.0F) - transducer_.elevationFocus) / transducer_.elevationRange;
    const float longer = transducer_.frequency / settings_.frequency;
    return transducer_.elevationWidth * longer * std::sqrt(1 + q * q) / perSigma;
}

float Beam::plane(int e) const noexcept
{
    const int n = settings_.planes;
    return n > 1 ? planeReach * (2 * static_cast<float>(e) / static_cast<float>(n - 1) - 1) : 0.0F;
}

glm::vec3 Beam::point(float l, float y, float z) const noexcept
{
    if (!curved())
        return {l, y, z};
    const float r = transducer_.radius;
    return {(r + z) * std::sin(l), y, (r + z) * std::cos(l) - r};
}

glm::vec3 Beam::direction(float l) const noexcept
{
    return curved() ? glm::vec3(std::sin(l), 0, std::cos(l)) : glm::vec3(0, 0, 1);
}

float Beam::halfWidth() const noexcept
{
    return curved() ? (transducer_.radius + settings_.depth) * std::sin(0.5F * transducer_.sector)
                    : 0.5F * transducer_.width;
}

glm::vec2 Beam::place(float lateral, float axial) const noexcept
{
    if (!curved())
        return {lateral, axial};
    const float z = axial + transducer_.radius;
    return {std::atan2(lateral, z), std::hypot(lateral, z) - transducer_.radius};
}

}  // namespace palpate::ultrasound
