#include <apps/export_ultrasound.h>

#include <base/outputs.h>
#include <channel/deformation.h>
#include <haptics/recorder.h>
#include <session/deformed_state.h>
#include <ultrasound/placement.h>
#include <ultrasound/scanner.h>
#include <ultrasound/stored_image.h>

#include <fmt/format.h>

#include <optional>

namespace palpate::apps {

std::string exportUltrasound(const UltrasoundExport& o, const std::function<void(double)>& progress)
{
    std::optional<ultrasound::StoredHow> like;
    double at = o.at;
    if (!o.like.empty()) {
        like = ultrasound::readStored(o.like);
        at = static_cast<double>(like->image.tick) / haptics::Record(o.record).info().rate;
    }
    const session::ShownState shown =
        session::shownState(o.record, at, like ? std::optional(like->image.shapeTick) : std::nullopt, progress);
    const haptics::Showing& s = shown.showing;
    ultrasound::Scanner scanner(s.scenery, s.labels, s.fine);
    channel::Deformation body(s.scenery, s.labels);
    body.apply(*shown.shape);
    ultrasound::BeamImage image;
    image.shapeTick = shown.shape->tick;
    image.mirrored = like && like->image.mirrored;
    if (like) {
        scanner.scan(like->image.transducer, like->image.settings, like->image.pose, body, shown.state, image);
    } else {
        const auto e = ultrasound::examinationOf(s.scenery, scanner.medium());
        scanner.scan(e.transducer, e.settings, ultrasound::poseAt(e, shown.state), body, shown.state, image);
    }
    base::writeWhole(o.output,
                     ultrasound::storedImage(image, like ? like->width : o.width, like ? like->height : o.height));
    return fmt::format(" at tick {}: {} probe, {:.0f} mm deep", shown.state.tick,
                       image.transducer.shape == ultrasound::ProbeShape::curved ? "curved" : "linear",
                       1e3F * image.settings.depth);
}

}  // namespace palpate::apps
