#include <datasets/scene.h>
#include <datasets/scene_text.h>
#include <datasets/tables.h>
#include <tests/error_of.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <cmath>
#include <random>
#include <sstream>

namespace palpate::datasets {
namespace {

const std::filesystem::path origin = "/data/scenes/full.toml";

std::string errorOf(const std::string& text)
{
    return tests::errorOf([&] { parseScene(text, origin); });
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
    scene.tool = {ToolKind::needle, draw(1e-3, 2e-3), draw(0.05, 0.2), draw(0.01, 0.03),
                  draw(0.01, 0.03), draw(2e-4, 8e-4), draw(1e-3, 8e-3)};
    scene.model = {ModelLevel::elastic, draw(1e-3, 4e-3), 3000, draw(0, 1000), true, true, "fast", true, {}};
    scene.model.elastic = {.spacing = draw(1e-3, 4e-3),
                           .window = 9 + 2 * static_cast<int>(draw(0, 16.99)),
                           .cycles = static_cast<int>(draw(1, 9)),
                           .law = volume::Exponential{},
                           .poissonCap = draw(0, 0.499),
                           .friction = draw(0, 1)};
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
    scene.probe = {.kind = ProbeKind::curved,
                   .face = *scene.entry,
                   .direction = {0.6, 0.8, 0},
                   .lateral = {-0.8, 0.6, 0},
                   .depth = draw(0.12, 0.2),
                   .frequency = draw(2e6, 6e6),
                   .focus = draw(0.02, 0.1),
                   .script = {}};
    // One draw a statement: arguments have no order.
    ProbeStep first, second;
    first.time = draw(0, 1);
    first.press = 1e-3;
    first.slide = draw(-0.1, 0.1);
    first.tilt = draw(-1, 1);
    second.time = 2;
    second.press = draw(0, 0.04);
    scene.probe.script = {first, second};
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
        EXPECT_NEAR(again.tool.tipLength, scene.tool.tipLength, 1e-12);
        EXPECT_EQ(again.model.level, ModelLevel::elastic);
        EXPECT_EQ(again.model.setting, "fast");
        const ElasticSettings &a = again.model.elastic, &e = scene.model.elastic;
        EXPECT_NEAR(a.spacing, e.spacing, 1e-12);
        EXPECT_EQ(a.window, e.window);
        EXPECT_EQ(a.cycles, e.cycles);
        EXPECT_EQ(a.law, volume::Law(volume::Exponential{}));
        EXPECT_NEAR(a.poissonCap, e.poissonCap, 1e-12);
        EXPECT_EQ(again.model.relaxation, scene.model.relaxation);
        EXPECT_EQ(again.model.walls, scene.model.walls);
        EXPECT_NEAR(a.friction, e.friction, 1e-12);
        EXPECT_EQ(again.probe.kind, ProbeKind::curved);
        EXPECT_NEAR(again.probe.lateral.x, -0.8, 1e-12);
        EXPECT_NEAR(again.probe.depth, scene.probe.depth, 1e-12);
        EXPECT_NEAR(again.probe.frequency, scene.probe.frequency, 1e-3);
        ASSERT_EQ(again.probe.script.size(), 2U);
        EXPECT_NEAR(again.probe.script[0].slide, scene.probe.script[0].slide, 1e-12);
        EXPECT_NEAR(again.probe.script[0].tilt, scene.probe.script[0].tilt, 1e-12);
    }
}

TEST(Scene, WhatItAsksForIsReadFromItsTextAlone)
{
    Scene scene = *builtInScene("layered");
    for (const SessionTask task : {SessionTask::biopsy, SessionTask::find, SessionTask::touch, SessionTask::advance}) {
        scene.task = task;
        EXPECT_EQ(parseScene(sceneText(scene), origin).task, task);
        EXPECT_EQ(aimOf(sceneText(scene)).task, task);
        EXPECT_EQ(aimOf(sceneText(scene)).tool, ToolKind::needle);
    }
    EXPECT_EQ(aimOf("task = \"find\"\n[volume]\nfile = \"gone.vdb\"\n[tool]\nkind = \"capsule\"\n").tool,
              ToolKind::capsule);
    EXPECT_EQ(aimOf("no scene").task, SessionTask::biopsy);
}

TEST(Scene, CtOfAnySceneComesBackAndADoseFollows)
{
    Scene scene = parseScene(
        "[volume]\nphantom = \"block\"\n[target]\naim_mm = [0, 25, 0]\n"
        "[ct]\nslices = 5\nslice_mm = 2.5\nctdi_mgy = 8\n",
        origin);
    EXPECT_EQ(scene.ct.slices, 5);
    EXPECT_NEAR(scene.ct.doseLength(), 8 * 5 * 0.25, 1e-12);
    const Scene again = parseScene(sceneText(scene), origin);
    EXPECT_EQ(again.ct.slices, 5);
    EXPECT_NEAR(again.ct.width, 2.5e-3, 1e-12);
    EXPECT_NEAR(again.ct.doseIndex, 8, 1e-12);
    scene.ct.slices = 0;
    EXPECT_FALSE(parseScene(sceneText(scene), origin).ct.given());
}

TEST(Scene, GravityOfAnySceneComesBack)
{
    const std::string scene = "[volume]\nphantom = \"block\"\n[target]\naim_mm = [0, 25, 0]\n[gravity]\n";
    const Scene named = parseScene(scene + "posture = \"prone\"\nshape = \"standing\"\nmodulus = 0.5\n", origin);
    EXPECT_EQ(named.gravity.down, Vec3(0, -1, 0));
    EXPECT_EQ(named.gravity.shapeDown, Vec3(0, 0, -1));
    const Scene aslant = parseScene(scene + "direction = [3, 0, -4]\nshape = \"unloaded\"\ng_m_s2 = 1.62\n", origin);
    EXPECT_NEAR(aslant.gravity.down.z, -0.8, 1e-12);
    EXPECT_EQ(aslant.gravity.shapeDown, Vec3(0.0));
    const Scene faint = parseScene(scene + "direction = [3e-200, 0, -4e-200]\nshape = \"unloaded\"\n", origin);
    EXPECT_NEAR(faint.gravity.down.z, -0.8, 1e-12);
    for (const Scene& s : {named, aslant}) {
        const Scene again = parseScene(sceneText(s), origin);
        EXPECT_EQ(sceneText(again), sceneText(s));
        EXPECT_EQ(again.gravity.modulus, s.gravity.modulus);
        EXPECT_EQ(again.gravity.strength, s.gravity.strength);
    }
    EXPECT_FALSE(parseScene("[volume]\nphantom = \"block\"\n[target]\naim_mm = [0, 25, 0]\n", origin).gravity.given);
}

// Tables have a column for each by its name.
TEST(Scene, TargetAndVitalStructuresHaveNamesOfTheirOwn)
{
    const std::string head = "[volume]\nphantom = \"layered\"\n[target]\nstructure = \"tumour\"\n";
    const std::string bone = "[[vital]]\nname = \"bone\"\n", tumour = "[[vital]]\nname = \"tumour\"\n";
    EXPECT_EQ(errorOf(head + bone), "");
    EXPECT_EQ(errorOf(head + bone + tumour),
              "/data/scenes/full.toml:4: [target] structure = \"tumour\": is in [[vital]] too: leave one of them out");
    EXPECT_EQ(errorOf(head + bone + bone),
              "/data/scenes/full.toml:8: [[vital]] name = \"bone\": is in another [[vital]] too: leave one of them out");
    EXPECT_EQ(parseRecordedScene(head + bone + bone + tumour, origin).vital.size(), 3U);
}

TEST(Scene, GravityIsRefusedWhereItSaysTooLittleOrTooMuch)
{
    const std::string scene = "[volume]\nphantom = \"block\"\n[target]\naim_mm = [0, 25, 0]\n[gravity]\n";
    EXPECT_NE(errorOf(scene + "posture = \"prone\"\n").find("[gravity] shape is missing"), std::string::npos)
        << errorOf(scene + "posture = \"prone\"\n");
    EXPECT_NE(errorOf(scene + "shape = \"prone\"\n").find("[gravity] posture is missing"), std::string::npos);
    EXPECT_NE(errorOf(scene + "posture = \"prone\"\ndirection = [0, 0, 1]\nshape = \"prone\"\n").find("direction"),
              std::string::npos);
    EXPECT_NE(errorOf(scene + "direction = [0, 0, 0]\nshape = \"prone\"\n").find("must not be [0, 0, 0]"),
              std::string::npos);
    EXPECT_NE(errorOf(scene + "posture = \"upside-down\"\nshape = \"prone\"\n").find("supine"), std::string::npos);
}

TEST(Scene, CtIsRefusedWhereItCannotBe)
{
    const auto refused = [](const std::string& more) {
        try {
            parseScene("[volume]\nphantom = \"block\"\n[target]\naim_mm = [0, 25, 0]\n" + more, origin);
        } catch (const std::runtime_error& e) {
            return std::string(e.what());
        }
        return std::string();
    };
    EXPECT_NE(refused("[ct]\nslices = 2\n").find("must be odd"), std::string::npos);
    EXPECT_NE(refused("[ct]\nslice_mm = 0\n").find("must be 0.5 to 20 mm"), std::string::npos);
    EXPECT_NE(refused("[ct]\ndose = 1\n").find("dose"), std::string::npos);
    EXPECT_NE(refused("[ct]\n[probe]\nkind = \"linear\"\nover_target = true\n").find("not by both"), std::string::npos);
    const std::string curved = "[probe]\nkind = \"curved\"\nover_target = true\n";
    EXPECT_EQ(refused(curved + "focus_mm = 140\n"), "");
    EXPECT_NE(refused(curved + "focus_mm = 141\n").find("must not be deeper than the picture, 140 mm"), std::string::npos);
    EXPECT_NE(refused(curved + "depth_mm = 200\nfocus_mm = 19\n").find("must be at least a tenth"), std::string::npos);
}

// Linear between the steps, from where it begins; after the last it stays. Rocking turns both axes within the plane.
TEST(Probe, GoesStraightFromStepToStep)
{
    ProbeSpec probe;
    probe.kind = ProbeKind::linear;
    probe.face = Vec3(0.1, 0.2, 0.3);
    probe.direction = Vec3(0, 1, 0);
    probe.lateral = Vec3(1, 0, 0);
    const auto probeAt = [&](double time) { return probeAfter(probe, scriptedMove(probe, time)); };
    EXPECT_EQ(probeAt(5).face, probe.face);
    probe.script = {{{4e-3, 2e-3}, 1}, {{0, 2e-3, -6e-3, 0.5}, 3}};
    const auto expectFace = [&](double t, Vec3 shift) {
        const Vec3 off = probeAt(t).face - probe.face - shift;
        EXPECT_NEAR(glm::length(off), 0, 1e-15) << t;
    };
    const Vec3 elevation = glm::cross(probe.direction, probe.lateral);
    expectFace(0, Vec3(0));
    expectFace(0.5, 2e-3 * probe.direction + 1e-3 * probe.lateral);
    expectFace(1, 4e-3 * probe.direction + 2e-3 * probe.lateral);
    expectFace(2, 2e-3 * probe.direction + 2e-3 * probe.lateral - 3e-3 * elevation);
    expectFace(9, 2e-3 * probe.lateral - 6e-3 * elevation);
    const ProbePlace rocked = probeAt(9);
    EXPECT_NEAR(glm::dot(rocked.direction, rocked.lateral), 0, 1e-15);
    EXPECT_NEAR(glm::dot(rocked.direction, probe.direction), std::cos(0.5), 1e-15);
    EXPECT_NEAR(glm::dot(rocked.direction, elevation), 0, 1e-15);
}

// Any move leaves two unit vectors across each other; alone, a tilt keeps the line along the face and a turn keeps the
// axis.
TEST(Probe, TurnsAsARigidBody)
{
    ProbeSpec probe;
    std::mt19937_64 random(4);
    std::uniform_real_distribution<double> angle(-1.4, 1.4);
    for (int i = 0; i < 100; ++i) {
        const ProbePlace p = probeAfter(probe, {.rock = angle(random), .tilt = angle(random), .turn = angle(random)});
        EXPECT_NEAR(glm::length(p.direction), 1, 1e-14);
        EXPECT_NEAR(glm::length(p.lateral), 1, 1e-14);
        EXPECT_NEAR(glm::dot(p.direction, p.lateral), 0, 1e-14);
        EXPECT_EQ(p.face, probe.face);
    }
    EXPECT_EQ(probeAfter(probe, {.tilt = 0.7}).lateral, probe.lateral);
    EXPECT_EQ(probeAfter(probe, {.turn = 0.7}).direction, probe.direction);
    EXPECT_NEAR(glm::dot(probeAfter(probe, {.tilt = 0.7}).direction, probe.direction), std::cos(0.7), 1e-15);
    EXPECT_NEAR(glm::dot(probeAfter(probe, {.turn = 0.7}).lateral, probe.lateral), std::cos(0.7), 1e-15);
}

const std::string head = "[volume]\nphantom = \"block\"\n[target]\nstructure = \"tumour\"\n";

TEST(Scene, EveryLevelAndEveryToolIsReadByItsName)
{
    for (const std::string_view word : modelLevels) {
        const Scene scene = parseScene(head + fmt::format("[model]\nlevel = \"{}\"\n", word), origin);
        EXPECT_EQ(name(scene.model.level), word);
        EXPECT_EQ(parseScene(sceneText(scene), origin).model.level, scene.model.level);
    }
    EXPECT_EQ(parseScene(head + "[model]\nlevel = \"elastic\"\n", origin).model.level, ModelLevel::elastic);
    for (const auto& [name, kind] : {std::pair{"sphere", ToolKind::sphere}, std::pair{"needle", ToolKind::needle},
                                     std::pair{"capsule", ToolKind::capsule}}) {
        const Scene scene = parseScene(head + fmt::format("[tool]\nkind = \"{}\"\n", name), origin);
        EXPECT_EQ(scene.tool.kind, kind);
        EXPECT_EQ(parseScene(sceneText(scene), origin).tool.kind, kind);
    }
}

// The work of a tick is some cycles over the nodes of a window: it rises from setting to setting, and nodes come closer.
TEST(ElasticSetting, FromFastToFineNodesAreNearerAndWorkIsMore)
{
    const std::vector<std::string> names = elasticSettings();
    ASSERT_EQ(names, (std::vector<std::string>{"fast", "default", "fine"}));
    EXPECT_EQ(elasticSetting("default"), ElasticSettings{});
    for (std::size_t i = 1; i < names.size(); ++i) {
        const ElasticSettings coarse = elasticSetting(names[i - 1]), fine = elasticSetting(names[i]);
        EXPECT_GT(coarse.spacing, fine.spacing);
        EXPECT_LT(coarse.cycles * std::pow(coarse.window, 3), fine.cycles * std::pow(fine.window, 3));
    }
    EXPECT_THROW(elasticSetting("coarse"), std::runtime_error);
}

TEST(ElasticSetting, KeepsWhatItsBaseSaysOfTheTissue)
{
    const ElasticSettings base{.law = volume::NeoHookean{}, .poissonCap = 0.4, .friction = 0.3};
    ElasticSettings expected = base;
    expected.spacing = elasticSetting("fine").spacing;
    expected.window = elasticSetting("fine").window;
    expected.cycles = elasticSetting("fine").cycles;
    EXPECT_EQ(elasticSetting("fine", base), expected);
}

TEST(ElasticSetting, IsReadByNameAndKeysBesideItWin)
{
    EXPECT_EQ(parseScene(head, origin).model.elastic, ElasticSettings{});
    for (const std::string& name : elasticSettings()) {
        const std::string text = head + fmt::format("[model]\nlevel = \"elastic\"\nsetting = \"{}\"\n", name);
        const Scene scene = parseScene(text, origin);
        EXPECT_EQ(scene.model.setting, name);
        EXPECT_EQ(scene.model.elastic, elasticSetting(name));
        EXPECT_EQ(parseScene(sceneText(scene), origin).model.elastic, elasticSetting(name));

        ElasticSettings expected = elasticSetting(name);
        expected.window = 21;
        expected.friction = 0.5;
        expected.law = volume::NeoHookean{};
        const Scene changed =
            parseScene(text + "[model.elastic]\nwindow = 21\nfriction = 0.5\nstrain = \"finite\"\n", origin);
        EXPECT_EQ(changed.model.elastic, expected);
        EXPECT_EQ(parseScene(sceneText(changed), origin).model.elastic, expected);
    }
}

TEST(Scene, LawsGoByName)
{
    const auto lawOf = [](const std::string& elastic) {
        return parseScene("[volume]\nphantom = \"block\"\n[target]\naim_mm = [0, 25, 0]\n[model.elastic]\n" + elastic,
                          origin)
            .model.elastic.law;
    };
    EXPECT_EQ(lawOf(""), volume::Law(volume::NeoHookean{}));
    EXPECT_EQ(lawOf("strain = \"finite\"\n"), volume::Law(volume::NeoHookean{}));
    EXPECT_EQ(lawOf("strain = \"small\"\n"), volume::Law(volume::SmallStrain{}));
    for (const volume::Law& law : volume::laws) {
        if (!volume::isSmall(law)) {
            EXPECT_EQ(lawOf(fmt::format("law = \"{}\"\n", volume::nameOf(law))), law);
        }
    }
    for (const char* wrong : {"strain = \"small\"\nlaw = \"exponential\"\n", "law = \"linear\"\n", "law = \"hooke\"\n"}) {
        EXPECT_THROW(lawOf(wrong), std::runtime_error) << wrong;
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
    for (const char* name : {"breast", "layered", "block", "plate", "pair"}) {
        EXPECT_TRUE(builtInScene(name)) << name;
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
        const bool flag = value == "true" || value == "false";
        const bool number = !flag && value[0] != '"' && value[0] != '[';
        std::vector<std::string> changes{flag ? key + " = 2" : key + " = true", key + " = { a = 1 }", key + " = 1979-05-27",
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

TEST(Scene, AProbeThatCannotBeIsRefused)
{
    const std::string probe = "[probe]\nkind = \"linear\"\nface_mm = [0, 0, 0]\ndirection = [0, 1, 0]\n";
    const auto expect = [&](const std::string& text, const std::string& what) {
        EXPECT_NE(errorOf(head + text).find(what), std::string::npos) << errorOf(head + text);
    };
    expect(probe + "lateral = [0, 2, 0]\n", "must not be along direction");
    expect(probe + "lateral = [0, 0, 0]\n", "must not be [0, 0, 0]");
    expect(probe, "lateral");
    expect("[[probe_step]]\nat_s = 1\n", "needs a [probe]");
    expect(probe + "lateral = [1, 0, 0]\n[[probe_step]]\nat_s = 1\n[[probe_step]]\nat_s = 1\n", "must be later");
    EXPECT_EQ(errorOf(head + probe + "lateral = [1, 0, 0]\n"), "");
}

TEST(Scene, AnUnknownKeyProposesTheNearest)
{
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
    EXPECT_EQ(errorOf(head + "[dffb]\nrange_mm = -4\n"),
              "/data/scenes/full.toml:6: [dffb] range_mm = -4 mm: must be 0 to 100 mm");
    EXPECT_EQ(errorOf(head + "[tool]\nkind = \"drill\"\n"),
              "/data/scenes/full.toml:6: [tool] kind = \"drill\": must be one of sphere, needle, capsule");
    EXPECT_EQ(errorOf(head + "[model]\nsetting = \"coarse\"\n"),
              "/data/scenes/full.toml:6: [model] setting = \"coarse\": must be one of fast, default, fine");
    EXPECT_EQ(errorOf(head + "[model.elastic]\nwindow = 12\n"),
              "/data/scenes/full.toml:6: [model.elastic] window = 12: must be odd");
    EXPECT_EQ(errorOf(head + "[model.elastic]\npoisson_cap = 0.5\n"),
              "/data/scenes/full.toml:6: [model.elastic] poisson_cap = 0.5: must be 0 to 0.499");
    EXPECT_EQ(errorOf(head + "[model.elastic]\npoisson = 1\n"),
              "/data/scenes/full.toml:6: [model.elastic] poisson: unknown key; did you mean poisson_cap?");
    EXPECT_EQ(errorOf(head + "[tool]\nlength_mm = 20\ntip_mm = 20\n"),
              "/data/scenes/full.toml:7: [tool] tip_mm = 20 mm: the tip must be shorter than the needle");
    EXPECT_NE(errorOf("[target]\nstructure = \"a\"\n").find("[volume] is missing"), std::string::npos);
    EXPECT_NE(errorOf("[volume]\nfile = \"a.vdb\"\n").find("[target] is missing"), std::string::npos);
    EXPECT_NE(errorOf("[volume]\nfile = \"a.vdb\"\nphantom = \"block\"\n").find(":1: volume"), std::string::npos);
}

}  // namespace
}  // namespace palpate::datasets
