#pragma once

// The ultrasound picture of a session that runs. Knows nothing of Python.

#include <channel/deformation.h>
#include <haptics/scenery.h>
#include <haptics/simulation.h>
#include <ultrasound/placement.h>
#include <ultrasound/scanner.h>

#include <memory>
#include <optional>

namespace palpate::python {

struct UltrasoundRequest {
    int width = 640, height = 640;         // [pixels]
    std::optional<ultrasound::Pose> pose;  // nothing: where the scene, or else the examination, has the probe
    double depth = 0;                      // of the picture [m]; 0: the probe's own
};

struct UltrasoundPicture {
    ultrasound::BeamImage image;
    ultrasound::Pixels pixels;
    double metresPerPixel = 0;
};

/// A scanner beside a session.
class LiveUltrasound {
public:
    /// Takes a second or less.
    explicit LiveUltrasound(const haptics::SessionModel& model);

    /// The body as `simulation` has it after its last tick, the tool and the cores as `state` has them: a function of those
    /// and of the request, bit for bit. Throws std::runtime_error for a size that no picture and a depth that no probe has.
    UltrasoundPicture picture(const haptics::Simulation& simulation, const channel::State& state,
                              const UltrasoundRequest& request);

private:
    haptics::Showing showing_;
    ultrasound::Scanner scanner_;
    channel::Deformation body_;
    ultrasound::Examination examination_;
    ultrasound::ScanConverter converter_;
    std::unique_ptr<channel::Displaced> shape_ = std::make_unique<channel::Displaced>();
};

}  // namespace palpate::python
