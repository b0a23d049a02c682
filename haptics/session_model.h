#pragma once

#include <chainmail/elastic_body.h>
#include <chainmail/lattice.h>
#include <chainmail/posture.h>
#include <datasets/scene.h>
#include <haptics/tick.h>
#include <volume/tissue.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace palpate::haptics {

/// The target or a vital structure, with its distance at rest.
struct GuardedStructure {
    std::string name;                   // as in the scene
    volume::DistanceField distance;     // at rest [m]
    double warnDistance = 0;            // [m]; 0 for the target
    double gain = 1;                    // of its proximity force
    std::vector<std::uint16_t> labels;  // its label values in the volume
};

/// Everything about a session that does not change while it runs.
struct SessionModel {
    datasets::Scene scene;                                  // its text is what a record keeps
    std::shared_ptr<const volume::Tissue> tissue;           // in the scene's posture; never null
    datasets::Approach approach;                            // the planned line, patient frame [m]
    volume::DistanceField surface;                          // of the body at rest [m]
    volume::ScalarField youngsModulus;                      // [Pa]
    chainmail::Lattice lattice;                             // its nodes are those of all fields
    std::shared_ptr<const chainmail::ElasticBody> elastic;  // level `elastic`: its cells are the lattice's nodes
    std::vector<GuardedStructure> structures;               // target first, then the lookup table of vital structures
    std::optional<chainmail::PostureFigures> posture;       // what gravity did to the volume; nothing: nothing
};

/// Builds fields and lattice; puts the volume into the scene's posture first, which takes seconds. Throws
/// std::runtime_error for structures that the volume does not have, more of them than maxStructures, and what
/// datasets::checkScene() refuses.
/// @param scene      what to build
/// @param tissue     its volume
/// @param isSession  a session needs a way to the target, and may step down to ChainMail: a tool that holds too many nodes
///                   for a tick is refused. What is none (palpate press) has approach.isPlanned false where there is no way
SessionModel buildModel(datasets::Scene scene, std::shared_ptr<const volume::Tissue> tissue, bool isSession = true);
/// Loads or makes the volume that the scene names first.
SessionModel buildModel(datasets::Scene scene, bool isSession = true);

}  // namespace palpate::haptics
