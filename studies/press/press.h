#pragma once

#include <chainmail/elastic.h>
#include <datasets/scene.h>
#include <haptics/session_model.h>
#include <studies/kernel/kernel_trial.h>
#include <studies/press/path_file.h>

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

namespace palpate::studies {

struct PressOptions {
    datasets::ToolSpec tool;
    std::size_t every = 1;  // a sample in every n-th tick, and in the last; at least 1
    bool converge = false;  // ticks with a sample are solved to convergence
};

/// The elastic body's answer to one pose, raw: without contact law, stabiliser and device.
struct PressSample {
    ToolPose pose;
    Vec3 force{0.0};                 // of the tissue on the tool [N]
    double contactArea = 0;          // [m^2]
    double energy = 0;               // of tissue and contacts [J]
    double residual = 0;             // forces out of balance before the tick's last step, fraction of the contacts' forces
    double depth = 0;                // of the deepest point of tissue inside the tool [m]
    double behind = 0;               // by how much the tool is held back, see chainmail::Elastic [m]
    double took = 0;                 // this thread's processor time [s]
    std::vector<Vec3> displacement;  // of the points asked for [m] (count x 1)
};

/// What all ticks say, also those without a sample.
struct PressSummary {
    std::size_t ticks = 0;
    std::size_t inContact = 0;     // of them
    std::size_t windowMoves = 0;   // in contact
    std::size_t notConverged = 0;  // samples that were to be solved to convergence and are not
    TickTimes times;               // of ticks in contact
    double peakForce = 0;          // magnitude [N]
    ToolPose peakAt;
    std::optional<double> heldFrom;  // when the tool is first held back [s]
};

/// Residual to which PressOptions::converge solves, fraction of the contacts' forces.
inline constexpr double pressTolerance = 1e-4;

/// Area of the surface that a tool presses, as it is stretched [m^2].
double contactArea(const chainmail::Elastic& elastic) noexcept;

/// Drives the elastic body along the path from rest, tick by tick, and hands over the samples.
/// @param asked  points at rest whose displacement is in each sample [m]
/// @pre  the model's level is elastic
/// Throws std::runtime_error for a needle that begins outside of the tissue, points outside of it, and a force that is not
/// finite. Deterministic but for times.
PressSummary press(const haptics::SessionModel& model, const PosePath& path, std::span<const FilePoint> asked,
                   const PressOptions& options, const std::function<void(const PressSample&)>& sample);

}  // namespace palpate::studies
