#include <studies/press/press.h>

#include <datasets/tables.h>

#include <tests/studies/pressed.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>

#include <memory>
#include <sstream>

namespace palpate::studies {
namespace {

// A column of fat, 70 mm long and 30 mm across, round at its free end; `skin` of it is skin [m]. Nothing in it is fixed: it
// stands on its back, y = 68.5 mm. In space everything lies at turn * q.
haptics::SessionModel column(double skin, const std::string& setting, const Mat3& turn)
{
    volume::LabelImage image;
    image.size = Index3(46, 76, 46);
    image.affine.linear = 1e-3 * turn;
    image.affine.origin = turn * Vec3(-22.5e-3, 0.0, -22.5e-3);
    volume::forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        const Vec3 q = 1e-3 * Vec3(n) - Vec3(22.5e-3, 3e-3, 22.5e-3);
        const double depth = 15e-3 - glm::length(Vec3(q.x, std::min(q.y - 15e-3, 0.0), q.z));
        image.values.push_back(depth <= 0.0 || n.y >= 73 ? 0 : depth <= skin ? 2 : 1);
    });
    const std::vector<volume::LabelName> names{{1, "fat", "fat"}, {2, "skin", "skin"}};
    const Vec3 entry = turn * Vec3(-15, 20, 0), aim = turn * Vec3(0, 20, 0);
    auto scene = datasets::parseScene(
        fmt::format("name = \"column\"\n[volume]\nphantom = \"block\"\n[model]\nlevel = \"elastic\"\nsetting = "
                    "\"{}\"\n[dffb]\nmode = \"off\"\n[target]\nstructure = \"fat\"\nentry_mm = [{}, {}, {}]\naim_mm = [{}, "
                    "{}, {}]\n",
                    setting, entry.x, entry.y, entry.z, aim.x, aim.y, aim.z),
        "column.toml");
    auto tissue =
        std::make_shared<const volume::Tissue>(volume::Tissue::fromLabels(image, datasets::defaultTissues(), names, {}));
    return haptics::buildModel(std::move(scene), std::move(tissue));
}

// Force of a ball of 10 mm, 5 and 10 mm deep in the column's side, 48.5 mm above its support [N].
std::pair<double, double> forces(const haptics::SessionModel& model, const Mat3& turn)
{
    std::ostringstream text;
    text << "seconds,x_mm,y_mm,z_mm\n";
    for (const glm::dvec2 at :
         {glm::dvec2(0, -1), glm::dvec2(0.3, 5), glm::dvec2(0.7, 5), glm::dvec2(0.95, 10), glm::dvec2(1.35, 10)}) {
        const Vec3 p = turn * Vec3(-25.0 + at.y, 20, 0);
        text << fmt::format("{},{},{},{}\n", at.x, p.x, p.y, p.z);
    }
    std::istringstream in(text.str());
    const PosePath path = readPosePath(in, "path.csv", Vec3(0, 1, 0));
    const auto samples = pressed(model, path, {.tool = toolOf(datasets::ToolKind::sphere, 10e-3, 0.0)}).samples;
    return {glm::length(samples.at(690).force), glm::length(samples.back().force)};
}

// A body that bends as a whole above what holds it, beside finite elements (quadratic, neo-Hookean, edges of 2.5 mm at the
// contact: `palpate-reference --looks 5,10`), 14.5 and 31.9 mN of fat alone, 65.3 and 141.6 mN under 2 mm of skin. Cells of
// 4 mm are coarser than skin and a sixth of the column's width.
TEST(PressColumn, BendsAboveItsSupportAsFiniteElementsDo)
{
    const Mat3 turned(glm::rotate(glm::rotate(glm::dmat4(1.0), 0.5, Vec3(1, 0, 0)), 0.3, Vec3(0, 0, 1)));
    struct Case {
        const char* setting;
        double bound;
    };
    for (const auto& [setting, bound] : {Case{"default", 0.10}, Case{"fine", 0.15}, Case{"fast", 0.25}}) {
        for (const Mat3& turn : {Mat3(1.0), turned}) {
            const auto [soft5, soft10] = forces(column(0.0, setting, turn), turn);
            EXPECT_NEAR(soft5 / 14.51e-3, 1.0, bound) << setting;
            EXPECT_NEAR(soft10 / 31.91e-3, 1.0, bound) << setting;
            const auto [skin5, skin10] = forces(column(2e-3, setting, turn), turn);
            EXPECT_NEAR(skin5 / 65.32e-3, 1.0, bound) << setting;
            EXPECT_NEAR(skin10 / 141.57e-3, 1.0, bound) << setting;
        }
    }
}

}  // namespace
}  // namespace palpate::studies
