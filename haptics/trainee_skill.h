#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace palpate::haptics {

/// How well a scripted trainee does it. docs/score.md has the sources; what has none there is assumed.
struct Skill {
    std::string_view name;
    double tremor = 0;      // root mean square, of the vector [m]
    double aimError = 0;    // of the aim as the trainee takes it from the picture, standard deviation per axis [m]
    double entryError = 0;  // of the place where the needle is set on the skin, likewise [m]
    double speed = 0;       // mean over a movement [m/s]
    double stroke = 0;      // longest movement without a look at the picture [m]
    double overshoot = 0;   // of a movement's length, standard deviation as a fraction of it
    double reaction = 0;    // to what is felt or seen [s]
    double vigilance = 0;   // probability of seeing before firing that the line misses, or that a vital structure is on it
    double content = 0;     // fraction of target in the cores seen that is enough
    int passes = 1;         // at most
    double touch = 0;       // palpation: of a stiffness that is felt, standard deviation as a fraction of it
    double raster = 8e-3;   // palpation: between presses of the first search [m]
    double plane = 0;       // ultrasound: of the picture's plane from the needle after a look, standard deviation [m]
    double wander = 0;      // of the hand that holds the probe, standard deviation of its speed [m/s]
};

/// "novice", "resident", "expert". Throws std::runtime_error for another name.
const Skill& skillCalled(std::string_view name);
std::vector<std::string> skillNames();

}  // namespace palpate::haptics
