#pragma once

#include <channel/deformation.h>
#include <ultrasound/checks.h>
#include <ultrasound/scanner.h>

#include <cmath>
#include <functional>
#include <memory>
#include <vector>

// For the checks only.
namespace palpate::ultrasound {

/// A box of tissue, x along the face, y across the picture, z down, with a linear probe whose face is 3 mm deep in it.
class CheckBench {
public:
    /// Which of `tissues` is at a point [m], from 1; 0 is air.
    using RowAt = std::function<std::uint8_t(glm::dvec3)>;

    CheckBench(const std::vector<channel::TissueSound>& tissues, double voxel, const RowAt& rowAt);

    /// Displaces the tissue: u at the rest point X [m].
    void displace(const std::function<glm::dvec3(glm::dvec3)>& u);
    void rest();
    /// A needle with its tip at `tip` that comes from `-axis`, 14 G.
    void insert(glm::dvec3 tip, glm::dvec3 axis);
    void scan();

    Beam beam() const { return {linearProbe(), settings}; }
    int line(double x) const;    // nearest to x of the box [m]
    int sample(double z) const;  // nearest to z of the box [m]
    double in(const std::vector<float>& power, int sample, int line) const;
    double power(int sample, int line) const { return in(envelope, sample, line); }
    double amplitude(int sample, int line) const { return std::sqrt(power(sample, line)); }
    /// Mean power in a part of the picture [dB]; samples and lines from .. to (excluded).
    double level(int fromSample, int toSample, int fromLine, int toLine) const;

    static constexpr double width = 44e-3, thickness = 16e-3, height = 46e-3;  // of the box [m]

    Settings settings = settingsOf(linearProbe());
    Pose pose;
    Physics physics;  // homogeneous, without noise
    BeamImage image;
    std::vector<float> envelope;  // its square (samples x lines)

private:
    channel::Scenery scenery_;
    std::vector<std::uint8_t> labels_, fine_;
    std::unique_ptr<Scanner> scanner_;
    std::unique_ptr<channel::Deformation> deformation_;
    channel::State state_;
};

/// dB of a ratio of amplitudes.
double decibels(double ratio);
/// Attenuation both ways at 9 MHz [dB/cm].
double attenuationOf(const channel::TissueSound& sound);
double reflectionOf(const channel::TissueSound& a, const channel::TissueSound& b);
/// Correlation of two pictures' envelopes over a part; `other(sample, line)` gives the second.
double correlation(const CheckBench& bench, int fromSample, int toSample, int fromLine, int toLine,
                   const std::function<double(int, int)>& other);

}  // namespace palpate::ultrasound
