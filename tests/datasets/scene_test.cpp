#include <datasets/scene.h>
#include <datasets/scene_text.h>
#include <datasets/tables.h>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <random>
#include <sstream>

namespace palpate::datasets {
namespace {

const std::filesystem::path origin = "/data/scenes/full.toml";

std::string errorOf(const std::string& text)
{
    try {
        parseScene(text, origin);
    } catch (const std::runtime_error& e) {
        return e.what();
    }
    return "no error";
}

/// A scene that uses every key, with values drawn from the ranges.
Scene fullScene(std::mt19937_64& random)
{
    const auto draw = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
    Scene scene;
    scene.name = "full";
    scene.tissues = "/data/tissues.toml";
    scene.source.phantom = {.name = "breast", .seed = random() >> 1U, .voxel = draw(0.5e-3, 2e-3)};
    scene.source.phantom.numbers = {{"tumour_depth_mm", draw(5, 20)}, {"tumours", 2}};
    scene.source.phantom.words = {{"tumour_kind", "ilc"}};
    scene.tool = {ToolKind::needle, draw(1e-3, 2e-3), draw(0.05, 0.2),
                  draw(0.01, 0.03), draw(0.01, 0.03), draw(2e-4, 8e-4)};
    scene.model = {ModelLevel::spring, draw(1e-3, 4e-3), 3000, draw(0, 1000)};
    scene.dffb.mode = DffbMode::thesis;
    for (ForceTerm* term : {&scene.dffb.surgery, &scene.dffb.structure, &scene.dffb.tissue, &scene.dffb.task}) {
        *term = {draw(0, 5), draw(0, 1), draw(0, 5), draw(0, 500)};
    }
    scene.dffb.floorDistance = draw(1e-3, 5e-3);
    scene.dffb.range = draw(0, 0.1);
    scene.dffb.budget = draw(0, 8);
    scene.vital = {{"artery", draw(0, 2), draw(0, 0.01)}, {"vein \"left\" \\ \t", draw(0, 2), draw(0, 0.01)}};
    scene.target = "tumour";
    scene.entry = Vec3(draw(-0.1, 0.1), draw(-0.1, 0.1), draw(-0.1, 0.1));
    scene.aim = Vec3(draw(-0.1, 0.1), draw(-0.1, 0.1), draw(-0.1, 0.1));
    scene.forceCap = draw(1, 8.5);
    using Kind = TraineeStep::Kind;
    scene.script = {{Kind::move, *scene.entry, draw(0.01, 0.1), 3, 1e-3},
                    {Kind::pierce, *scene.aim, draw(0.01, 0.1), 3, 2e-3},
                    {Kind::press, *scene.aim, draw(0.01, 0.1), 3, 2e-3},
                    {Kind::fire, Vec3(0), 0.02, 0, 1e-3},
                    {Kind::wait, Vec3(0), 0.02, draw(0.1, 1), 1e-3}};
    return scene;
}

TEST(Scene, TextOfAnySceneGivesTheSceneBack)
{
    std::mt19937_64 random(11);
    for (int round = 0; round < 50; ++round) {
        const Scene scene = fullScene(random);
        const Scene again = parseScene(sceneText(scene), origin);
        EXPECT_EQ(sceneText(again), sceneText(scene));
        EXPECT_NEAR(again.tool.throwLength, scene.tool.throwLength, 1e-12);
        EXPECT_EQ(again.vital.at(1).name, scene.vital.at(1).name);
        EXPECT_EQ(again.source.phantom.seed, scene.source.phantom.seed);
        EXPECT_NEAR(again.aim->y, scene.aim->y, 1e-12);
        EXPECT_EQ(again.dffb.mode, DffbMode::thesis);
        EXPECT_EQ(again.script.at(1).kind, TraineeStep::Kind::pierce);
    }
}

TEST(Scene, BuiltInScenesParseAndTheirTextParsesToTheSame)
{
    for (const std::string& name : builtInScenes()) {
        const std::optional<Scene> scene = builtInScene(name);
        ASSERT_TRUE(scene) << name;
        EXPECT_EQ(scene->name, name);
        const Scene again = parseScene(scene->text, "/elsewhere/record.db");
        EXPECT_EQ(again.text, scene->text);
        EXPECT_EQ(sceneText(again), sceneText(*scene));
        EXPECT_EQ(sceneText(parseScene(sceneText(*scene), origin)), sceneText(*scene));
        EXPECT_FALSE(sceneVolume(*scene).labelsNamed(scene->target).empty());
    }
    EXPECT_FALSE(builtInScene("knee"));
}

TEST(Scene, RelativePathsStartAtTheScenesFolderAndTheTextKeepsThem)
{
    const std::string text =
        "name = \"p\" # \xC3\xA4\n[volume]\n\xF0\x9F\x98\x80 = 1\n";  // not a bare key: refused, with its line
    EXPECT_NE(errorOf(text).find("/data/scenes/full.toml:3: not TOML"), std::string::npos);

    const Scene scene =
        parseScene("volume = { file = \"b\xC3\xA4r/v.vdb\" } # 1 \xC3\xA4\n[target]\nstructure = \"x\"\n", origin);
    EXPECT_EQ(scene.source.file, "/data/scenes/b\xC3\xA4r/v.vdb");
    const Scene again = parseScene(scene.text, "/elsewhere/record.db");
    EXPECT_EQ(again.source.file, scene.source.file);
    EXPECT_EQ(again.text, scene.text);
    EXPECT_EQ(again.target, "x");

    const Scene table =
        parseScene("tissues = '''../t.toml'''\n[volume]\nphantom = \"block\"\n[target]\nstructure = \"tumour\"\n", origin);
    EXPECT_EQ(table.tissues, "/data/t.toml");
    EXPECT_EQ(parseScene(table.text, "/x/y").tissues, "/data/t.toml");
}

// Breaks every key of a full scene in every way; each error must name the file, the line and the key.
TEST(Scene, EveryBrokenKeyIsNamedWithFileAndLine)
{
    std::mt19937_64 random(5);
    std::istringstream in(sceneText(fullScene(random)));
    std::vector<std::string> lines;
    for (std::string line; std::getline(in, line);) {
        lines.push_back(line);
    }
    int broken = 0;
    for (std::size_t at = 0; at < lines.size(); ++at) {
        const std::size_t equals = lines[at].find(" = ");
        if (equals == std::string::npos) {
            continue;
        }
        const std::string key = lines[at].substr(0, equals), value = lines[at].substr(equals + 3);
        const bool number = value[0] != '"' && value[0] != '[';
        std::vector<std::string> changes{key + " = true", key + " = { a = 1 }", key + " = 1979-05-27",
                                         number ? key + " = \"text\"" : key + " = 3"};
        if (number) {
            changes.insert(changes.end(), {key + " = nan", key + " = -inf", key + " = 1e9", key + " = -1e9"});
        } else {
            changes.insert(changes.end(),
                           {key + " = \"\"", key + " = [1, 2]", key + " = [1, 2, nan]", key + " = [1, 2, 1e9]"});
        }
        for (const std::string& change : changes) {
            std::string text;
            for (std::size_t l = 0; l < lines.size(); ++l) {
                text += (l == at ? change : lines[l]) + "\n";
            }
            const std::string error = errorOf(text);
            EXPECT_EQ(error.rfind(fmt::format("/data/scenes/full.toml:{}: ", at + 1), 0), 0U) << change << "\n" << error;
            EXPECT_NE(error.find(key + " = "), std::string::npos) << change << "\n" << error;
            ++broken;
        }
    }
    EXPECT_GT(broken, 300);
}

TEST(Scene, AnUnknownKeyProposesTheNearest)
{
    const std::string head = "[volume]\nphantom = \"block\"\n[target]\nstructure = \"tumour\"\n";
    EXPECT_EQ(errorOf(head + "[dffb]\nrnage_mm = 4\n"),
              "/data/scenes/full.toml:6: [dffb] rnage_mm: unknown key; did you mean range_mm?");
    EXPECT_EQ(errorOf(head + "[dffb.surgery]\nforce = 4\n"),
              "/data/scenes/full.toml:6: [dffb.surgery] force: unknown key; did you mean force_n?");
    EXPECT_EQ(errorOf(head + "[tols]\nradius_mm = 4\n"), "/data/scenes/full.toml:5: tols: unknown key; did you mean tool?");
    EXPECT_EQ(errorOf(head + "[volume.parameters]\nwidht_mm = 4\n"),
              "/data/scenes/full.toml:6: [volume.parameters] widht_mm: unknown key; did you mean width_mm?");
}

TEST(Scene, ARangeErrorReadsAsPromised)
{
    const std::string head = "[volume]\nphantom = \"block\"\n[target]\nstructure = \"tumour\"\n";
    EXPECT_EQ(errorOf(head + "[dffb]\nrange_mm = -4\n"),
              "/data/scenes/full.toml:6: [dffb] range_mm = -4 mm: must be 0 to 100 mm");
    EXPECT_EQ(errorOf(head + "[tool]\nkind = \"drill\"\n"),
              "/data/scenes/full.toml:6: [tool] kind = \"drill\": must be one of sphere, needle");
    EXPECT_NE(errorOf("[target]\nstructure = \"a\"\n").find("[volume] is missing"), std::string::npos);
    EXPECT_NE(errorOf("[volume]\nfile = \"a.vdb\"\n").find("[target] is missing"), std::string::npos);
    EXPECT_NE(errorOf("[volume]\nfile = \"a.vdb\"\nphantom = \"block\"\n").find(":1: volume"), std::string::npos);
}

}  // namespace
}  // namespace palpate::datasets
