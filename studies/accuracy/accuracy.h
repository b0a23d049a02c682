#pragma once

#include <haptics/session_model.h>
#include <studies/kernel/baselines/baseline.h>

#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace palpate::studies {

/// What the accuracy chart presses, and how: a sphere of 10 mm radius at 20 mm/s.
struct AccuracySubject {
    std::shared_ptr<const haptics::SessionModel> model;
    TrialPath path;
    double speed = 0;              // [m/s]
    std::filesystem::path pathOf;  // the reference whose path it is; "" = the scene's own, as no reference was taken yet

    double poissonCap() const { return model->scene.model.elastic.poissonCap; }
    BaselineScene scene() const { return {*model->tissue, model->surface, path, poissonCap()}; }
};
/// Throws std::runtime_error when there is no soft tissue under the scene's entry.
AccuracySubject accuracySubject(std::shared_ptr<const haptics::SessionModel> model);

/// Tissue that does not move ("nothing"), and with level spring's force ("spring").
std::vector<Baseline> rigidMethods(const AccuracySubject& subject);
/// Level elastic, from the coarsest windows that still help to far more than a millisecond has time for: small strain
/// ("elastic") and finite strain ("elastic_finite").
std::vector<Baseline> elasticMethods(const AccuracySubject& subject);
/// The same solver on one grid over the whole body ("single_grid", "single_grid_finite").
std::vector<Baseline> singleGridMethods(const AccuracySubject& subject);
/// All of them, with the baselines of others. The subject must outlive what they build.
std::vector<Baseline> accuracyMethods(const AccuracySubject& subject);

/// How one method did.
struct AccuracyRun {
    std::vector<TrialResult> results;  // one per reference; empty when it failed
    std::string failure;               // why
    bool hasForce = false;             // the method has a force of its own
    double buildSeconds = 0;           // before the first tick [s]
};

/// Builds the method and drives it along the subject's path. One that throws std::runtime_error, or whose ticks take
/// longer than `maxSeconds` in all, or whose errors are no finite numbers, has failed.
AccuracyRun runAccuracy(const Baseline& method, const AccuracySubject& subject,
                        std::span<const Reference* const> references, double maxSeconds);

/// Time and error of a method at a setting.
struct AccuracyPoint {
    double seconds = 0;
    double error = 0;
};

/// The points that no other one beats in both (fastest first; of equal ones the first). Points that are not finite are
/// never among them.
std::vector<std::size_t> paretoFront(std::span<const AccuracyPoint> points);

}  // namespace palpate::studies
