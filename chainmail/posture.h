#pragma once

#include <chainmail/posture_map.h>
#include <volume/tissue.h>

namespace palpate::chainmail {

/// Under which gravity the shape of a volume was taken, and under which it shall be, patient frame [m/s^2]; zero: unloaded.
struct Gravity {
    Vec3 taken{0.0};
    Vec3 now{0.0};
};

/// How finely a posture is computed, and of what the tissue is.
struct PostureSettings {
    double spacing = 4e-3;          // of the cells [m]; widened where there would be over maxNodes
    std::size_t maxNodes = 200000;  // of the cells' grid
    double poissonCap = 0.49;       // Poisson's ratios above are lowered to this [-]
    double modulus = 1;             // of all tissue's moduli in the table's [-]
    bool relaxed = false;           // and that of a long time after a step
    int maxRounds = 40;             // to find the unloaded shape
};

/// What it came to.
struct PostureFigures {
    double spacing = 0;   // of the cells [m]
    double weight = 0;    // of the tissue that is not held, under `now` [N]
    double farthest = 0;  // that tissue moves from where the volume has it [m]
    int rounds = 0;       // to find the unloaded shape; 0: the volume has it
    double residual = 0;  // by which that shape, loaded as it was taken, misses the volume's, at most [m]
};

/// A volume in another posture: its tissue in equilibrium under its weight, neo-Hookean (with `stiffening`) and nearly
/// incompressible, by the cells of level `elastic`.
///
/// Held are what a session holds (ElasticBody), and tissue that the volume's border cuts. Nothing else touches the body.
/// The unloaded shape of a volume that was taken under gravity is found by iteration: each point of it goes to where the
/// volume has it, less what it moves by under the load, until none is off by over a tenth of a voxel. Sources: V.
/// Rajagopal et al., "Determining the finite elasticity reference state from a loaded configuration", Int. J. Numer.
/// Methods Eng. 72, 2007; M. Sellier, "An iterative method for the inverse elasto-static problem", J. Fluids Struct. 27,
/// 2011.
struct Posture {
    PostureMap map;
    PostureFigures figures;
};

/// Throws std::runtime_error for a volume without tissue, and where no equilibrium or no unloaded shape is found.
Posture postureOf(const volume::Tissue& tissue, const Gravity& gravity, const PostureSettings& settings = {});

}  // namespace palpate::chainmail
