#include <haptics/posed.h>

#include <base/error.h>
#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace palpate::haptics {

namespace {

void checkPlan(const datasets::Scene& scene)
{
    const auto refuse = [&](std::string_view what, std::string_view instead) {
        throw base::error("{}: [gravity]: {} do not move with the tissue: {}", scene.name, what, instead);
    };
    if (std::ranges::any_of(scene.script, [](const datasets::TraineeStep& step) {
            return step.kind != datasets::TraineeStep::Kind::fire && step.kind != datasets::TraineeStep::Kind::wait;
        })) {
        refuse("the places of [[script]]", "leave it out, so that the needle follows the plan");
    }
    if (scene.probe.kind != datasets::ProbeKind::none && !scene.probe.overTarget) {
        refuse("the places of [probe]", "over_target = true puts it over the target as it is then");
    }
}

std::optional<Vec3> moved(const datasets::Scene& scene, const chainmail::PostureMap& map, std::string_view key,
                          const std::optional<Vec3>& place)
{
    if (!place) {
        return place;
    }
    const std::optional<Vec3> to = map.moved(*place);
    if (!to) {
        const Vec3 mm = *place * 1e3;
        throw base::error(
            "{}: [target] {} = [{:g}, {:g}, {:g}] mm: [gravity] moves it with the tissue, and "
            "there is none",
            scene.name, key, mm.x, mm.y, mm.z);
    }
    return to;
}

}  // namespace

Posed posed(const datasets::Scene& scene, std::shared_ptr<const volume::Tissue> tissue)
{
    const datasets::GravitySpec& g = scene.gravity;
    if (!g.given || g.down == g.shapeDown || g.strength <= 0.0) {
        return {std::move(tissue), scene.entry, scene.aim, std::nullopt};
    }
    checkPlan(scene);
    const chainmail::PostureSettings settings{
        .poissonCap = scene.model.elastic.poissonCap, .modulus = g.modulus, .relaxed = scene.model.relaxation};
    const auto posture = [&] {
        try {
            return chainmail::postureOf(*tissue, {g.strength * g.shapeDown, g.strength * g.down}, settings);
        } catch (const std::runtime_error& e) {
            throw base::error("{}: [gravity]: {}", scene.name, e.what());
        }
    }();
    Posed out{nullptr, moved(scene, posture.map, "entry_mm", scene.entry), moved(scene, posture.map, "aim_mm", scene.aim),
              posture.figures};
    out.tissue =
        std::make_shared<const volume::Tissue>(chainmail::inPosture(*tissue, posture.map, textOf(posture.figures)));
    return out;
}

std::string textOf(const chainmail::PostureFigures& figures)
{
    const std::string found = figures.rounds > 0 ? fmt::format("; unloaded shape found within {:.2f} mm in {} rounds",
                                                               1e3 * figures.residual, figures.rounds)
                                                 : std::string();
    return fmt::format("tissue moved by up to {:.1f} mm under {:.1f} N of its own weight, cells of {:.1f} mm{}",
                       1e3 * figures.farthest, figures.weight, 1e3 * figures.spacing, found);
}

}  // namespace palpate::haptics
