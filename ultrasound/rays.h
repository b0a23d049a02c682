#pragma once

#include <ultrasound/rest_shifts.h>
#include <ultrasound/view.h>

#include <array>
#include <vector>

namespace palpate::ultrasound {

struct RayOptions {
    bool interfaces = true;  // Fresnel reflections
};

/// Sends a ray along every line in every plane: attenuation by the tissues it crosses, mirror echoes where the impedance
/// changes, the needle, and what is dark behind them.
///
///     attenuation   A *= 10^(-2 a f^p ds / 20)
///     interface     R = tanh(half the change of ln Z), one echo at its centre, of amplitude
///                   R (0.9 exp(-t^2 / 2 (0.25 rad)^2) + 0.1 cos t) at t off the perpendicular; 1 - R^2 goes on
///     needle        0.93 less 0.6 dB a degree off broadside; echoes to and fro between its walls behind it; 0.02 goes on;
///                   its tip echoes in all directions, also behind its own shaft, for the aperture looks around that. All
///                   of it goes by the share of the beam in elevation that the needle covers: from y - r to y + r
///                   (Phi((y + r) / s) - Phi((y - r) / s)), so that it fades evenly as it leaves the picture's plane
///     gas           all comes back, and again at multiples of its depth
///
/// Sources: Buerger et al., IEEE TMI 32:609, 2013 (convolution-enhanced ray tracing); Schafhalter-Zoppoth et al., Reg
/// Anesth Pain Med 2004, and Nichols et al., JVIR 14:1553, 2003 (visibility of needles by angle); shares of mirror and
/// rough reflection, and the fall of reverberations: assumed.
class RayCaster {
public:
    /// @param needle  null: there is none in the picture
    void cast(const View& view, const Needle* needle, const RayOptions& options, Shade& shade, EchoLines& echoes);

private:
    // An interface that a ray is crossing: sums over its steps.
    struct Crossing {
        float change = 0;             // of half ln Z
        float weight = 0, depth = 0;  // of its absolute value, and that times the depth
        float amplitude = 0;          // that reached it
        glm::vec3 normal{0};
        std::uint8_t before = 0;  // label of what is before it
    };
    // What a line meets of a needle; the same in each plane.
    struct NeedleHit {
        float at = 1e9F, echo = -1;      // depth [m] and echo of the shaft; below 0: not on this line
        float behind = 1;                // of the amplitude goes on
        float off = 1e9F;                // of the shaft there from the picture's plane [m]
        float low = 1e9F, high = -1e9F;  // of the shaft in elevation [m]
        float tipAt = -1, tipEcho = 0;
    };
    struct Ray {
        int line = 0, plane = 0;
        float weight = 1;     // of its plane
        float amplitude = 1;  // left by the tissue
        float behind = 1;     // and of that by the needle
        glm::vec3 step{0};    // at rest [voxels]
        Crossing crossing;
        std::uint8_t last = unknown;  // label of the point before
        float lnZ = 0;                // there, if it was not pure
        NeedleHit needle;
        bool inside = false, stopped = false;
    };

    void prepare(const View& view);
    glm::vec3 pointAt(const Beam& beam, int line, int plane, int row) const;
    void castLine(const View& view, const RayOptions& options, Ray& ray, Shade& shade, EchoLines& echoes);
    NeedleHit meetNeedle(const Beam& beam, const Needle& needle, int line) const;
    void meetPiece(const Beam& beam, const Needle& needle, std::size_t piece, float way, int line, NeedleHit& hit) const;
    float dimmed(const Beam& beam, float depth, float slope) const;
    void echoNeedle(Ray& ray, EchoLines& echoes) const;
    void cross(const Medium& medium, glm::vec3 v, std::uint8_t label, float depth, Ray& ray, EchoLines& echoes) const;
    void release(Ray& ray, EchoLines& echoes) const;
    void stopAtAir(Ray& ray, float depth, EchoLines& echoes) const;
    void deposit(EchoLines& echoes, int line, float depth, float re, float im) const;
    void fillShadows(const View& view, Shade& shade);

    std::array<float, 256> left_{};  // fraction of the amplitude after one step in a tissue
    std::vector<float> planeWeight_;
    std::vector<NeedleHit> needle_;          // by line
    std::vector<float> before_, now_, raw_;  // of fillShadows()
    RestShifts rest_;                        // of the plane that is cast
    float step_ = 0, sample_ = 0;
    float needleRadius_ = 0;
};

/// The share of a Gaussian beam of deviation `sigma` that lies between `low` and `high` of its middle.
float shareBetween(float low, float high, float sigma) noexcept;

/// Echo of a shaft whose line makes `degrees` with the perpendicular of the ray.
float needleEcho(float degrees) noexcept;

}  // namespace palpate::ultrasound
