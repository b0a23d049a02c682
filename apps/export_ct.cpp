#include <apps/export_ct.h>

#include <base/error.h>
#include <base/outputs.h>
#include <channel/deformation.h>
#include <ct/scanner.h>
#include <haptics/recorder.h>
#include <haptics/score.h>
#include <session/deformed_state.h>

#include <fmt/format.h>

#include <algorithm>

namespace palpate::apps {

std::string exportCt(const CtExport& o, const std::function<void(double)>& progress)
{
    base::failIf(!(haptics::scanDoseOf(haptics::Record(o.record).info()) > 0),
                 "{}: its scene has no CT: take a record of a scene with a section [ct]", o.record);
    const session::ShownState shown = session::shownState(o.record, o.at, std::nullopt, progress);
    const haptics::Showing& s = shown.showing;
    channel::Deformation body(s.scenery, s.labels);
    body.apply(*shown.shape);
    const ct::Scan scan = ct::Scanner(s.scenery, s.image).scan(shown.state, body);
    const auto& window = *std::ranges::find(ct::windows, o.window, &ct::Window::name);
    base::writeWhole(o.output, ct::scanPng(scan, shown.state.tick, s.scenery.ctDoseLength, window, o.side));
    return fmt::format(" at tick {}: {} slices of {:.1f} mm, {:.1f} mGy cm", shown.state.tick, scan.hu.size(),
                       1e3 * s.scenery.ctWidth, s.scenery.ctDoseLength);
}

}  // namespace palpate::apps
