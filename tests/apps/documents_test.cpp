#include <datasets/label_map.h>
#include <datasets/scene.h>
#include <datasets/scene_text.h>
#include <datasets/tables.h>

#include <tests/apps/program.h>
#include <tests/error_of.h>

#include <gtest/gtest.h>

#include <map>
#include <regex>
#include <sstream>

namespace palpate::apps {
namespace {

// One row of a table in docs/scenes.md whose range is two numbers.
struct Row {
    std::string section, key, low, high, standard;
};

std::string page()
{
    return readText(PALPATE_SOURCE_DIR "/docs/scenes.md");
}

std::vector<Row> rows()
{
    static const std::regex heading(R"(^## `\[+([a-z.]+)\]+`.*)");
    static const std::regex row(R"(^\| `(\w+)` \|[^|]*\| (-?[\d.]+) to ([\d.]+) \| ([\d.]+) \|.*)");
    std::vector<Row> out;
    std::string section, line;
    std::smatch m;
    for (std::istringstream in(page()); std::getline(in, line);) {
        if (std::regex_match(line, m, heading)) {
            section = m[1];
        } else if (std::regex_match(line, m, row)) {
            out.push_back({section, m[1], m[2], m[3], m[4]});
        }
    }
    return out;
}

// A scene with each section once, and one more line in one of them.
std::string sceneWith(const std::string& section, const std::string& line)
{
    std::map<std::string, std::string> lines{{"[volume]", "phantom = \"layered\""},
                                             {"[tool]", ""},
                                             {"[model]", ""},
                                             {"[model.elastic]", ""},
                                             {"[dffb]", ""},
                                             {"[dffb.surgery]", ""},
                                             {"[[vital]]", "name = \"bone\""},
                                             {"[[insert]]", "centre_mm = [0, 0, 0]"},
                                             {"[target]", "structure = \"tumour\""},
                                             {"[safety]", ""},
                                             {"[ct]", ""},
                                             {"[gravity]", "posture = \"prone\"\nshape = \"supine\""},
                                             {"[[script]]", "kind = \"fire\""}};
    std::string out;
    for (const auto& [heading, text] : lines) {
        const bool here = heading == "[" + section + "]" || heading == "[[" + section + "]]";
        out += heading + "\n" + text + "\n" + (here ? line + "\n" : "");
    }
    return out;
}

std::string refusal(const std::string& text)
{
    return tests::errorOf([&] { datasets::parseScene(text, "scene.toml"); });
}

TEST(Documents, RangesOfScenesAreTheParsers)
{
    const auto all = rows();
    EXPECT_GT(all.size(), 20U) << "the tables of docs/scenes.md look different now";
    for (const Row& row : all) {
        SCOPED_TRACE("[" + row.section + "] " + row.key);
        const std::string error = refusal(sceneWith(row.section, row.key + " = -1000000000000"));
        std::smatch m;
        ASSERT_TRUE(std::regex_search(error, m, std::regex(R"(must be (\S+) to (\S+))"))) << error;
        EXPECT_EQ(std::stod(m[1]), std::stod(row.low));
        EXPECT_EQ(std::stod(m[2]), std::stod(row.high));
    }
}

// sceneText() writes every key with its value: of a scene that sets none, the defaults.
TEST(Documents, DefaultsOfScenesAreTheParsersAndNoKeyIsMissing)
{
    const std::string text = datasets::sceneText(datasets::parseScene(sceneWith("", ""), "scene.toml"));
    static const std::regex heading(R"(^\[+([a-z.]+)\]+)"), setting(R"(^(\w+) = (.*))");
    std::map<std::pair<std::string, std::string>, std::string> values;
    const std::string documented = page();
    std::string section, line;
    std::smatch m;
    for (std::istringstream in(text); std::getline(in, line);) {
        if (std::regex_match(line, m, heading)) {
            section = m[1];
        } else if (std::regex_match(line, m, setting)) {
            values[{section, m[1]}] = m[2];
            EXPECT_TRUE(m[1] == "name" || documented.find("| `" + m[1].str() + "` |") != std::string::npos) << line;
        }
    }
    for (const Row& row : rows()) {
        SCOPED_TRACE("[" + row.section + "] " + row.key);
        const auto found = values.find({row.section, row.key});
        ASSERT_NE(found, values.end());
        EXPECT_DOUBLE_EQ(std::stod(found->second), std::stod(row.standard));
    }
}

TEST(Documents, SettingsOfLevelElasticAreThePrograms)
{
    for (const std::string& name : datasets::elasticSettings()) {
        const datasets::ElasticSettings setting = datasets::elasticSetting(name);
        std::ostringstream row;
        row << "| `" << name << "` | " << 1e3 * setting.spacing << " | " << setting.window << " | " << setting.cycles
            << " |\n";
        EXPECT_NE(page().find(row.str()), std::string::npos) << row.str();
    }
}

TEST(Documents, EveryKeyOfAScoreIsExplained)
{
    const std::string text = readText(PALPATE_SOURCE_DIR "/docs/score.md");
    const auto trained = figures({"train", "layered", "--headless", "--unpaced", "--seconds", "0.1"});
    for (const auto& [key, value] : trained.at("score").items()) {
        EXPECT_NE(text.find("`" + key + "`"), std::string::npos) << key;
    }
}

TEST(Documents, TheExamplesLoad)
{
    const Folder folder;
    const std::string text = page();
    std::vector<std::string> files;
    for (std::size_t begin = 0; (begin = text.find("```toml\n", begin)) != std::string::npos;) {
        begin += 8;
        files.push_back(folder / (std::to_string(files.size()) + ".toml"));
        writeText(files.back(), text.substr(begin, text.find("```", begin) - begin));
    }
    ASSERT_EQ(files.size(), 4U);
    EXPECT_EQ(datasets::loadScene(files[0]).target, "tumour_2");
    EXPECT_EQ(datasets::loadTissues(files[1]).name, "mine");
    const datasets::LabelMap map = datasets::labelMap(files[2]);
    EXPECT_EQ(map.labels.size(), 2U);
    EXPECT_EQ(map.segments.size(), 1U);
    EXPECT_EQ(datasets::stiffnessMap(files[3], "HU", datasets::defaultTissues()).points.size(), 3U);
}

}  // namespace
}  // namespace palpate::apps
