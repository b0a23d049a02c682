#pragma once

#include <channel/layout.h>

#include <glm/vec3.hpp>

#include <cstddef>
#include <limits>
#include <vector>

namespace palpate::render {

/// The way of a tool's tip in tissue, since it went in last.
class TipWay {
public:
    /// Not earlier than those before.
    void add(const channel::State& state);
    /// The way up to `time` [s]; while the tool is out, the last one [m].
    std::vector<glm::dvec3> until(double time = std::numeric_limits<double>::infinity()) const;

private:
    struct Place {
        double time = 0;      // [s]
        glm::dvec3 tip{0.0};  // [m]
        bool isFirst = false;
    };

    std::vector<Place> places_;
    std::size_t start_ = 0;  // of the way that goes on
    double step_ = 0;        // from one place to the next [m]: a long way has fewer of them
    bool isIn_ = false;
};

}  // namespace palpate::render
