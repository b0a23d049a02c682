#include <base/error.h>
#include <datasets/scene_fields.h>
#include <datasets/scene_text.h>

#include <cmath>

namespace palpate::datasets {

namespace {

// Each tool is one that a scene's text may have, but for its size: `palpate press` has larger and shorter ones.
void checkTool(const std::string& scene, const ToolSpec& tool)
{
    for (const Field<ToolSpec>& f : toolFields) {
        const double value = tool.*std::get<double ToolSpec::*>(f.member);
        base::failIf(!std::isfinite(value) || (f.low >= 0.0 && value < 0.0),
                     "{}: [tool] {} = {} {}: must be a {}finite number", scene, f.key, value / f.si, f.unit,
                     f.low >= 0.0 ? "positive, " : "");
    }
    base::failIf(tool.radius <= 0.0, "{}: [tool] radius_mm = {} mm: must be over 0 mm", scene, 1e3 * tool.radius);
}

void checkPlace(const std::string& scene, std::string_view key, const std::optional<Vec3>& place)
{
    for (int axis = 0; place && axis < 3; ++axis) {
        base::failIf(!(std::abs((*place)[axis]) <= 1e-3 * farthestCoordinate),
                     "{}: [target] {} = [{:g}, {:g}, {:g}]: each must be {:g} to {:g} mm", scene, key, 1e3 * place->x,
                     1e3 * place->y, 1e3 * place->z, -farthestCoordinate, farthestCoordinate);
    }
}

}  // namespace

void checkScene(const Scene& scene)
{
    checkTool(scene.name, scene.tool);
    checkFields<ModelSettings>(scene.name + ": [model]", modelFields, scene.model);
    if (scene.model.level == ModelLevel::elastic) {
        const ElasticSettings& elastic = scene.model.elastic;
        checkFields<ElasticSettings>(scene.name + ": [model.elastic]", elasticFields, elastic);
        base::failIf(elastic.window % 2 == 0, "{}: [model.elastic] window = {}: must be odd", scene.name, elastic.window);
    }
    checkPlace(scene.name, "entry_mm", scene.entry);
    checkPlace(scene.name, "aim_mm", scene.aim);
}

}  // namespace palpate::datasets
