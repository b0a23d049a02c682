#pragma once

#include <render/coach.h>

#include <glm/vec3.hpp>

#include <optional>

namespace palpate::render {

/// Tells somebody who holds the tool for the first time what the hand does, one thing after the other: each is done before
/// the next is told.
class Tryout {
public:
    /// @param seconds  of the session, for the time that is left [s]
    explicit Tryout(double seconds) : seconds_(seconds) {}

    /// What a window shows above it: its body is of no interest.
    static const char* heading();
    /// @param held  the dead-man switch of mouse or keys
    Coaching see(const channel::Scenery& scenery, const channel::State& state, bool held);

private:
    bool done(const channel::Scenery& scenery, const channel::State& state, bool held);

    double seconds_;
    int step_ = 0;
    std::optional<glm::dvec3> from_;  // of the tip, when the step began [m]
};

}  // namespace palpate::render
