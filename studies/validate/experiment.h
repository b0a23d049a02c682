#pragma once

#include <volume/geometry.h>
#include <volume/law.h>
#include <volume/relaxation.h>

#include <glm/vec2.hpp>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace palpate::studies {

/// What a needle meets in liver, as it is fitted.
struct LiverLaw {
    double cutting = 0;      // force at the tip [N]
    double wallSpacing = 0;  // mean distance between inner walls [m]; 0: none
    double wallForce = 0;    // mean of what they hold beyond the cutting force [N]
    volume::Relaxation relaxation = {};
};

/// Force of a needle that goes in at an even speed, is held, and comes out.
struct NeedleStroke {
    std::vector<double> in, out;  // size of the force at even steps of depth, along and against the way [N]
    std::vector<double> held;     // at each of `heldAt` [N]
    std::size_t falls = 0;        // of `minRupture` or more on the way in
};
inline constexpr double strokeStep = 2e-3;  // of depth [m]
inline constexpr double fineStep = 0.5e-3;  // the same, as finely as the measurements have it [m]
inline constexpr double minRupture = 0.15;  // [N]

/// Our needle in a block of liver, 80 mm wide.
/// @param aside    of the block's middle, where it goes in [m]
/// @param depth    how far in [m]
/// @param heldAt   seconds after it stands
NeedleStroke needleStroke(const LiverLaw& liver, glm::dvec2 aside, double depth, const std::vector<double>& heldAt);

/// Walls that give so many falls of `minRupture` or more, of that mean size, where what walls hold is exponentially
/// distributed: its excess over any limit has the same mean. No walls where there is no fall.
/// @param falls    per insertion [-]
/// @param size     mean of these [N], over `minRupture`
/// @param length   of the way through the tissue [m]
/// @return         with cutting force and relaxation left at 0
LiverLaw fittedWalls(double falls, double size, double length);

/// Falls of `minRupture` or more within 1 mm, from a peak to the least force after it [N].
/// @param most, least  of the force in each `fineStep` of depth [N]
std::vector<double> rupturesIn(const std::vector<double>& most, const std::vector<double>& least);

/// A line or points of an experiment's picture.
struct ValidateCurve {
    std::string name;
    std::vector<double> x, y;
    bool line = true;  // false: points

    void add(double atX, double atY)
    {
        x.push_back(atX);
        y.push_back(atY);
    }
};

struct ValidatePicture {
    std::string title, xLabel, yLabel;
    std::vector<ValidateCurve> curves;
    bool empty() const noexcept { return curves.empty(); }
};

enum class Verdict : std::uint8_t { holds, fails, notRun };

/// What was measured, what was fitted on which part, what was predicted, and how far off that is. All errors are in
/// percent, of what `quantity` says, and an experiment holds when `error` is at most `bound`.
struct Experiment {
    std::string name;      // as the command takes it
    std::string quantity;  // that is compared, and what the percentage is of
    std::string source;    // of the measurement
    std::string fittedOn;
    std::string predicted;
    double error = 0;    // RMS, or what `quantity` says [%]
    double worst = 0;    // largest single error [%]
    double scatter = 0;  // of the measurement [%]
    double bound = 0;    // [%]
    Verdict verdict = Verdict::notRun;
    std::string note;                                        // what it shows, or why it was not run
    std::vector<std::pair<std::string, double>> parameters;  // that were fitted, and other figures, with unit in the name
    ValidatePicture picture;

    /// Sets the verdict by error and bound; an error that is not finite fails.
    void judge() noexcept { verdict = error <= bound ? Verdict::holds : Verdict::fails; }
};

/// The larger of two errors; one that is no number wins, so that it is not lost.
inline double largerError(double a, double b) noexcept
{
    return std::isnan(a) || a >= b ? a : b;
}

/// Root of the mean square, and the largest size; no numbers where one of the errors is none.
struct ErrorSummary {
    double rms = 0, worst = 0;
};
ErrorSummary summaryOf(const std::vector<double>& errors) noexcept;

/// Called with what is being done.
using ValidateProgress = std::function<void(const std::string&)>;

/// A law of finite strain, of tissue that keeps its volume.
struct Incompressible {
    double shear = 0;       // mu [Pa]
    double stiffening = 0;  // b [-]
    volume::Law law = volume::NeoHookean{};

    double energy(double invariant) const noexcept;  // [J/m^3]
    double slope(double invariant) const noexcept;   // dW/dI [Pa]
};

/// Nominal stress of a bar stretched to `stretch` times its length [Pa]; under 0: it is pressed.
double uniaxialStress(const Incompressible& law, double stretch) noexcept;

/// The factor by which a curve of `shape` comes nearest to `values`, least squares.
double scaleOf(const std::vector<double>& shape, const std::vector<double>& values) noexcept;

/// A cylinder between two platens.
struct Cylinder {
    double radius = 25e-3, height = 30e-3;  // [m]
    double poisson = 0.495;
    double cell = 1.875e-3;  // of the kernel's cells [m]; divides the height
};

/// Load of a cylinder of shear modulus 1 Pa, by the kernel's cells, at each engineering strain [N].
/// @param stiffening  b of the law [-]
/// @param bonded      no slip on the platens; false: no friction
/// Throws std::runtime_error where no equilibrium is found.
std::vector<double> compressionLoads(const Cylinder& shape, double stiffening, bool bonded,
                                     const std::vector<double>& strains);

/// Ecoflex cylinders in compression: neo-Hookean and Yeoh, without friction and bonded; and what bonding makes of a
/// modulus. The modulus of each material is fitted from 2 to 10 % strain, Yeoh's b on all the other materials.
/// @param file   measurements, see datasets/measured/README.md
/// @param quick  larger cells
/// Throws as Measurements does.
std::vector<Experiment> siliconeCompression(const std::filesystem::path& file, bool quick,
                                            const ValidateProgress& progress);

/// A beam of 100 x 30 x 30 mm of the kernel's cells, clamped at x = -100 mm, z up, under its own weight and a load on the
/// upper edge of its free end x = 0.
struct Beam {
    double youngsModulus = 0;       // [Pa]
    double poisson = 0.49;          // [-]; of scenes. Silicone has 0.499, which bends alike and drowns single precision
    double density = 1070;          // [kg/m^3]
    double tipLoad = 0;             // [N]
    Vec3 gravity{0.0, 0.0, -9.81};  // [m/s^2]
    double cell = 5e-3;             // [m]; divides 10 mm
};

/// Displacement of the three markers, which stand 6 mm off the surface and turn with it [m].
/// Throws std::runtime_error where no equilibrium is found.
std::array<Vec3, 3> beamMarkers(const Beam& beam);

/// The silicone beam: Young's modulus fitted on the drop under its own weight, the drop under a tip load predicted.
/// @param file   measurements, see datasets/measured/README.md
/// @param quick  larger cells
/// Throws as Measurements does.
Experiment siliconeBeam(const std::filesystem::path& file, bool quick, const ValidateProgress& progress);

/// The weights whose Prony series is nearest to these ratios G(t) / G(0), least squares; none is under 0.
volume::Relaxation fittedRelaxation(const std::vector<double>& seconds, const std::vector<double>& ratios);

/// A needle into human liver: tip force, force on the way in, ruptures, held force. Fitted on the curves with even numbers,
/// compared with those with odd ones.
/// @param curves, hold  measurements, see datasets/measured/README.md
/// Throws as Measurements does.
std::vector<Experiment> needleInLiver(const std::filesystem::path& curves, const std::filesystem::path& hold,
                                      const ValidateProgress& progress);

/// Tissue that relaxes at level `elastic`, beside closed forms of a generalised Maxwell solid; F_e is the force of the same
/// tissue right after a step, taken from a run without relaxation.
///
/// A ball is pressed in evenly and held: F(t) is the sum of G(t - s) dF_e(s), G the Prony series (a contact that grows
/// follows the hereditary integral, Lee and Radok 1960). And a ball that swings by a, deep in tissue, loses
/// pi a^2 F_e' (w_1 x_1 / (1 + x_1^2) + w_2 x_2 / (1 + x_2^2)) in a turn, x_i being the time t_i times 2 pi f.
/// @param quick  half as long
std::vector<Experiment> relaxation(bool quick, const ValidateProgress& progress);

/// A lump in a block of fat under a fingertip that is pressed 6 mm deep, as in the sweep `palpation`.
struct Lump {
    double diameter = 0;       // [m]
    double youngsModulus = 0;  // [Pa]; 0: it is of fat, as all around it
    double depth = 0;          // from the surface to its nearest point [m]
};

/// Force of the tissue on the fingertip [N]. Throws as a scene does.
double forceOver(const Lump& lump);

/// Order in which 80 physicians detected lumps (by size and hardness) beside the order of the contrast of force.
/// @param file  literature_facts_read.csv, see datasets/measured/README.md
/// Throws as Measurements does.
Experiment palpationOrder(const std::filesystem::path& file, const ValidateProgress& progress);

}  // namespace palpate::studies
