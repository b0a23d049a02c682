#pragma once

#include <datasets/scene.h>
#include <haptics/arm.h>
#include <volume/tissue.h>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::studies {

/// What a hand does next: its goal goes to `to` in a straight line and stays there.
struct HandLeg {
    Vec3 to{0.0};      // [m]
    double speed = 0;  // of the goal [m/s]
    double wait = 0;   // once it is there [s]
};

/// Where a hand wants to be, as a function of time.
struct HandPath {
    Vec3 start{0.0};  // [m]
    double wait = 0;  // before the first leg [s]
    std::vector<HandLeg> legs;
    double ease = 0;  // every leg starts and ends with so long a constant acceleration [s]; no leg is shorter

    Vec3 at(double time) const noexcept;
    /// From the start of a leg of that length to its end, without its wait [s]; it takes `ease` longer than at its speed.
    double duration(double length, double speed) const noexcept { return length / speed + ease; }
    /// When leg `leg` is over, its wait included; legs.size() - 1 gives the path's duration [s].
    double end(std::size_t leg) const noexcept;
    double seconds() const noexcept { return end(legs.size() - 1); }
};

/// What is measured of a session in a scene. Lower is better for all of them.
enum class Figure : std::uint8_t {
    popThrough,  // how far behind the plate's far face the tool gets while nothing pushes it back [mm]
    ripple,      // amplitude of a wave with the variance of the size of the force, of its mean [%]
    forceStep,   // largest change of the force, of the cap [% per ms]
    restCycle,   // peak to peak of the tool at rest [encoder steps]
    kick,        // highest speed over what the hand's own spring makes of the force that gave way [%]
    energyMade,  // most energy that the hand has got out, less what it put in [J]
    residue,     // largest displacement that is left when the tool is away [voxels]
    peakForce,   // largest force, of the cap [%]
    pull,        // largest component of the tissue's force into the body, along y, of the cap [%]
};
std::string_view name(Figure figure) noexcept;
std::string_view unit(Figure figure) noexcept;

struct Bounded {
    Figure figure = Figure::energyMade;
    double bound = 0;  // in the figure's unit: higher fails
};

/// A small body and what a hand does to it: a place where methods are known to fail.
struct StabilityScene {
    std::string name;         // "slide-30deg-20mm_s"
    std::string kind;         // "slide"
    std::string meaning;      // one line
    datasets::Scene session;  // tool and model; no volume, no script, no additional force
    std::shared_ptr<const volume::Tissue> tissue;
    HandPath hand;
    haptics::Grip grip;
    Vec3 axis{0, 1, 0};       // of the tool, towards its tip
    double from = 0, to = 0;  // what is measured [s]
    double letGo = 0;         // when a hand that lets go does so [s]
    Bounded held, released;   // of a hand that holds on, and of one that lets go
    bool onlyReleased = false;
    bool pierced = false;   // asks for a method that a needle can pierce
    double farFace = 0;     // of a plate, along y [m]
    double staleEvery = 0;  // poses are stale at the end of every such time [s]; 0 = never
    double staleFor = 0;    // for so long [s]
    bool quick = false;     // in the short matrix
};

/// All scenes, in a fixed order. Volumes are made when first asked for.
std::vector<StabilityScene> stabilityScenes();

inline constexpr double sceneVoxel = 1e-3;  // edge of a voxel of all scenes [m]

}  // namespace palpate::studies
