#include <python/live_ultrasound.h>

#include <haptics/broadcast.h>

#include <fmt/format.h>

#include <stdexcept>

namespace palpate::python {

LiveUltrasound::LiveUltrasound(const haptics::SessionModel& model)
    : showing_(haptics::showingOf(model, false, haptics::displayGrid(*model.tissue))),
      scanner_(showing_.scenery, showing_.labels, showing_.fine),
      body_(showing_.scenery, showing_.labels),
      examination_(ultrasound::examinationOf(showing_.scenery, scanner_.medium()))
{
}

UltrasoundPicture LiveUltrasound::picture(const haptics::Simulation& simulation, const channel::State& state,
                                          const UltrasoundRequest& request)
{
    constexpr int most = 8192;  // pixels along a side
    if (request.width < 16 || request.height < 16 || request.width > most || request.height > most) {
        throw std::runtime_error("ultrasound: width and height are 16 to 8192 pixels");
    }
    haptics::showShape(simulation, *shape_);
    shape_->tick = state.tick;
    body_.apply(*shape_);
    ultrasound::Settings settings = examination_.settings;
    if (request.depth > 0) {
        const auto depth = static_cast<float>(request.depth);
        if (depth < examination_.transducer.shallowest || depth > examination_.transducer.deepest) {
            throw std::runtime_error(fmt::format("ultrasound: a depth of {:g} m: the probe has {:g} to {:g} m",
                                                 request.depth, examination_.transducer.shallowest,
                                                 examination_.transducer.deepest));
        }
        settings.depth = static_cast<float>(request.depth);
        settings = ultrasound::within(settings, examination_.transducer);
    }
    UltrasoundPicture out;
    out.image.shapeTick = state.tick;
    const auto pose = request.pose ? *request.pose : ultrasound::poseAt(examination_, state);
    scanner_.scan(examination_.transducer, settings, pose, body_, state, out.image);
    converter_.convert(out.image, request.width, request.height, out.pixels);
    const ultrasound::Beam beam(examination_.transducer, settings);
    out.metresPerPixel =
        1.0 / static_cast<double>(ultrasound::Layout(beam, request.width, request.height).pixelsPerMetre());
    return out;
}

}  // namespace palpate::python
