#include <base/inputs.h>
#include <base/png.h>
#include <haptics/measures.h>
#include <report/data.h>
#include <report/groups.h>
#include <report/html.h>
#include <report/measure_table.h>
#include <report/path.h>
#include <report/report.h>

#include <tests/haptics/synthetic_session.h>

#include <gtest/gtest.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <random>

namespace palpate::report {
namespace {

using haptics::Record;
namespace synthetic = haptics::synthetic;

std::string between(const std::string& text, const std::string& from, const std::string& to)
{
    const std::size_t start = text.find(from);
    const std::size_t end = text.find(to, start + from.size());
    return start == std::string::npos || end == std::string::npos
               ? ""
               : text.substr(start + from.size(), end - start - from.size());
}

// However few rows stay, the least and the largest value of every column are among them, the ends stay, and the abscissa
// still rises.
TEST(Decimator, KeepsExtremesEndsAndOrder)
{
    std::mt19937 random(2);
    std::normal_distribution<double> noise(0, 1);
    for (const std::size_t rows : {1U, 2U, 17U, 4000U, 50000U}) {
        Decimator decimator(4, rows, 400);
        std::vector<std::vector<double>> all;
        for (std::size_t i = 0; i < rows; ++i) {
            all.push_back({static_cast<double>(i), noise(random), noise(random), noise(random)});
            decimator.add(all.back());
        }
        const auto kept = decimator.finish();
        ASSERT_EQ(kept.size(), 4U);
        EXPECT_LE(kept[0].size(), 402U);
        EXPECT_EQ(kept[0].front(), 0);
        EXPECT_EQ(kept[0].back(), static_cast<double>(rows - 1));
        EXPECT_TRUE(std::ranges::is_sorted(kept[0]));
        for (std::size_t c = 1; c < 4; ++c) {
            const auto column = [c](const std::vector<double>& row) { return row[c]; };
            EXPECT_EQ(std::ranges::max(kept[c]), std::ranges::max(all, {}, column)[c]);
            EXPECT_EQ(std::ranges::min(kept[c]), std::ranges::min(all, {}, column)[c]);
        }
    }
}

TEST(Decimator, FewRowsStayAsTheyAre)
{
    Decimator decimator(2, 100, 4000);
    for (int i = 0; i < 100; ++i) {
        decimator.add({i * 1.0, std::sin(i)});
    }
    EXPECT_EQ(decimator.finish()[0].size(), 100U);
}

// Force k d while going in and k d / 2 while coming out: each bin's mean is that of its middle.
TEST(ReportData, ProfileSeparatesGoingInFromComingOut)
{
    const synthetic::Folder folder;
    std::vector<haptics::TickRecord> ticks(40000);
    for (std::size_t n = 0; n < ticks.size(); ++n) {
        const bool in = n < 20000;
        const double depth = 0.04 * (in ? static_cast<double>(n) : static_cast<double>(40000 - n)) / 20000;
        ticks[n].tick = n;
        ticks[n].phase = haptics::Phase::inserted;
        ticks[n].inserted = depth;
        ticks[n].total.y = (in ? 1.0 : 0.5) * 100 * depth;
    }
    synthetic::record(folder / "a", synthetic::info(), ticks);
    const DepthProfile p = collect(Record(folder / "a")).profile;
    ASSERT_GE(p.depth.size(), 80U);
    for (std::size_t i = 2; i < 78; ++i) {
        EXPECT_NEAR(p.in[i], 0.1 * p.depth[i], 0.002);
        EXPECT_NEAR(p.out[i], 0.05 * p.depth[i], 0.002);
        EXPECT_NEAR(p.peak[i], 0.1 * (p.depth[i] + 0.25), 0.002);
    }
}

// The tip of a bent needle is where its notch is, and not where the hand would have it.
TEST(ReportData, ThePathIsTheTips)
{
    const synthetic::Folder folder;
    std::vector<haptics::TickRecord> ticks(100);
    for (std::size_t n = 0; n < ticks.size(); ++n) {
        ticks[n].tick = n;
        ticks[n].phase = haptics::Phase::inserted;
        ticks[n].device.position = {0, 1e-3 * static_cast<double>(n), 0};
        ticks[n].deflection = {0, 0, 3e-5 * static_cast<double>(n)};
    }
    synthetic::record(folder / "a", synthetic::info(), ticks);
    const Record record(folder / "a");
    const ReportData data = collect(record);
    for (const PathPoint& p : data.path) {
        EXPECT_NEAR(p.tip.z, 0.03 * p.tip.y, 1e-9);
    }
    EXPECT_NEAR(data.score.insertedPath, 99e-3 * std::hypot(1, 0.03), 1e-6);
}

// Somebody who draws the tool far out of the body has a picture of the body nevertheless.
TEST(PathCard, ShowsTheBodyHoweverFarThePathGoes)
{
    ReportData data;
    for (int n = 0; n <= 100; ++n) {
        data.path.push_back({Vec3(0, -5.0 * (100 - n), 0), false});
    }
    for (int n = 0; n <= 40; ++n) {
        data.path.push_back({Vec3(0, n, 0), true});
    }
    data.entries.push_back(Vec3(0.0));
    const std::string card = pathCard(data, synthetic::info());
    std::size_t at = 0;
    int entries = 0;
    for (; (at = card.find("<circle cx=\"", at)) != std::string::npos; ++at) {
        const std::string circle = card.substr(at, card.find("/>", at) - at);
        if (circle.find("#b07040") == std::string::npos) {
            continue;
        }
        ++entries;
        for (const char* axis : {"cx=\"", "cy=\""}) {
            const double pixel = std::stod(circle.substr(circle.find(axis) + 4));
            EXPECT_GT(pixel, 0) << circle;
            EXPECT_LT(pixel, 300) << circle;
        }
    }
    EXPECT_EQ(entries, 3);
}

// Task k takes k + 1 us in every tick but each 50th, in which it takes ten times that: p50 and p99 are those two.
TEST(ReportData, TaskTimesArePercentiles)
{
    const synthetic::Folder folder;
    std::vector<haptics::TickRecord> ticks(5000);
    for (std::size_t n = 0; n < ticks.size(); ++n) {
        ticks[n].tick = n;
        for (std::size_t k = 0; k < haptics::taskCount; ++k) {
            ticks[n].seconds[k] = static_cast<float>(static_cast<double>(k + 1) * (n % 50 == 0 ? 1e-5 : 1e-6));
        }
    }
    synthetic::record(folder / "a", synthetic::info(), ticks);
    const ReportData d = collect(Record(folder / "a"));
    for (std::size_t k = 0; k < haptics::taskCount; ++k) {
        EXPECT_NEAR(d.tasks[k].p50, static_cast<double>(k + 1), 1e-3);
        EXPECT_NEAR(d.tasks[k].p99, 10 * static_cast<double>(k + 1), 1e-3);
    }
    EXPECT_NEAR(d.tick.p50, 28, 1e-3);
}

// Nothing is loaded: no address of a network, no link, no source but data in the page. Text of the record stays text.
// A finger that presses `times` times, each 2 mm beside the last.
std::vector<haptics::TickRecord> presses(std::size_t times)
{
    std::vector<haptics::TickRecord> ticks(4 * times);
    for (std::size_t n = 0; n < ticks.size(); ++n) {
        const bool down = n % 4 == 2;
        ticks[n].tick = n;
        ticks[n].phase = down ? haptics::Phase::contact : haptics::Phase::free;
        ticks[n].device.position = {2e-3 * static_cast<double>(n / 4 % 10), down ? 0.0 : -0.01, 0.0};
    }
    return ticks;
}

// Of a palpation with a lot of presses: a dot for each in each of the three views, or it is said how many are drawn.
TEST(Report, EveryContactIsDrawnOrCounted)
{
    const synthetic::Folder folder;
    const auto pathOf = [&](std::size_t times) {
        const auto file = folder / std::to_string(times);
        synthetic::record(file, synthetic::info(), presses(times));
        writeReport(folder / "r.html", Record(file), {}, file);
        return between(base::contentOf(folder / "r.html").value(), "<h2>Path of the tip</h2>", "</section>");
    };
    const auto dots = [](const std::string& text) {
        std::size_t count = 0;
        for (auto at = text.find("fill=\"#b07040\""); at != std::string::npos; at = text.find("fill=\"#b07040\"", at + 1)) {
            ++count;
        }
        return count;
    };
    const std::string all = pathOf(67), some = pathOf(700);
    EXPECT_EQ(dots(all), 3 * 67U);
    EXPECT_EQ(all.find("the first"), std::string::npos);
    EXPECT_EQ(dots(some), 3 * 500U);
    EXPECT_NE(some.find("where the tip met the skin (the first 500 of 700)"), std::string::npos);
}

TEST(Report, IsOneFileAndEscapesTheRecord)
{
    const synthetic::Folder folder;
    synthetic::record(folder / "a", synthetic::info(), synthetic::procedure(5, 0.5, 1),
                      {{"<i>key</i>", "<i>value</i>"}, {"missed_ticks", "17"}});
    std::filesystem::create_directory(folder / "pictures");
    std::ofstream(folder / "pictures/one.png") << "Man";
    std::ofstream(folder / "pictures/two.png") << "Ma";
    std::ofstream(folder / "pictures/notes.txt") << "secret";
    writeReport(folder / "r.html", Record(folder / "a"), folder / "pictures");
    const std::string html = base::contentOf(folder / "r.html").value();

    EXPECT_NE(html.find("breast &lt;phantom&gt; &amp; &quot;more&quot;"), std::string::npos);
    EXPECT_EQ(html.find("<phantom>"), std::string::npos);
    EXPECT_EQ(html.find("<b>not markup"), std::string::npos);
    EXPECT_EQ(html.find("<i>value"), std::string::npos);
    EXPECT_NE(html.find("Missed ticks: 17."), std::string::npos);
    for (const std::string outside : {"src=\"http", "href=", "@import", "url(", "<link"}) {
        EXPECT_EQ(html.find(outside), std::string::npos) << outside;
    }
    EXPECT_NE(html.find("data:image/png;base64,TWFu\""), std::string::npos);
    EXPECT_NE(html.find("data:image/png;base64,TWE=\""), std::string::npos);
    EXPECT_EQ(html.find("secret"), std::string::npos);
    EXPECT_NE(html.find("var uPlot"), std::string::npos);
    EXPECT_FALSE(std::filesystem::exists(folder / "r.html.part"));
}

// The charts' data are the record's: length, peak of the force, and nothing where a distance is not finite.
TEST(Report, ChartsHoldTheRecord)
{
    const synthetic::Folder folder;
    haptics::SessionInfo info = synthetic::info();
    info.structures[1] = "</script><script>alert(1)</script>";
    info.sceneText = "[volume]\nphantom = \"block\"\n[target]\nstructure = \"tumour\"\n[safety]\ncap_n = 6.5\n";
    auto ticks = synthetic::procedure(10, 0.3, 1);
    ticks[3000].additional = {0, 0, 7.25};
    ticks[3000].distance[1] = std::numeric_limits<double>::infinity();
    synthetic::record(folder / "a", info, ticks);
    writeReport(folder / "r.html", Record(folder / "a"));
    const std::string html = base::contentOf(folder / "r.html").value();
    const auto data = nlohmann::json::parse(between(html, "id=\"data\">", "</script>"));
    const auto& forces = data["charts"]["forces"]["columns"];
    EXPECT_LE(forces[0].size(), 4002U);
    EXPECT_DOUBLE_EQ(forces[0].back().get<double>(), 9.999);
    EXPECT_DOUBLE_EQ(std::ranges::max(forces[2].get<std::vector<double>>()), 7.25);
    EXPECT_DOUBLE_EQ(data["charts"]["forces"]["lines"][0]["at"].get<double>(), 6.5);
    EXPECT_EQ(data["charts"]["distances"]["series"][2]["label"], info.structures[1]);
    EXPECT_EQ(data["charts"]["distances"]["columns"].size(), 5U);
    EXPECT_TRUE(std::ranges::any_of(data["events"], [](const auto& e) { return e["kind"] == "fire"; }));
}

// Half of the scene's cap is near it; of a scene that cannot be read none is known.
TEST(Report, TheCapIsTheScenes)
{
    const synthetic::Folder folder;
    for (const auto& [cap, lines] : {std::pair("cap_n = 5\n", 1U), {"cap_n = 20\n", 0U}, {"cap_n = \"5\"\n", 0U}}) {
        haptics::SessionInfo info = synthetic::info();
        info.sceneText = "[volume]\nphantom = \"block\"\n[target]\nstructure = \"tumour\"\n[safety]\n" + std::string(cap);
        auto ticks = synthetic::procedure(4, 0.3, 1);
        ticks[2000].additional = {0, 0, 4.5};
        synthetic::record(folder / cap, info, ticks);
        writeReport(folder / "r.html", Record(folder / cap));
        const auto data =
            nlohmann::json::parse(between(base::contentOf(folder / "r.html").value(), "id=\"data\">", "</script>"));
        ASSERT_EQ(data["charts"]["forces"]["lines"].size(), lines) << cap;
        if (lines > 0) {
            EXPECT_DOUBLE_EQ(data["charts"]["depth"]["lines"][0]["at"].get<double>(), 5.0);
        }
    }
}

// A fast push leaves bins of the depth without a tick; the force of one between two such stands beside nothing that a line
// could be drawn to, and is in the chart all the same.
TEST(Report, ForcesBetweenGapsAreDrawn)
{
    const synthetic::Folder folder;
    synthetic::record(folder / "a", synthetic::info(), synthetic::procedure(5, 0.5, 1));
    writeReport(folder / "r.html", Record(folder / "a"));
    const auto data =
        nlohmann::json::parse(between(base::contentOf(folder / "r.html").value(), "id=\"data\">", "</script>"));
    for (const char* chart : {"depth", "nearest"}) {
        for (const auto& series : data["charts"][chart]["series"]) {
            EXPECT_EQ(series["gaps"], false) << chart << " " << series["label"];
        }
    }
}

// All pictures of events, some of the others, in the order of the times that the viewer wrote into them.
TEST(Report, PicturesStandInTheOrderOfTheirTimes)
{
    const synthetic::Folder folder;
    std::filesystem::create_directory(folder / "pictures");
    const auto picture = [&](const std::string& name, const std::string& seconds) {
        constexpr std::array<std::uint8_t, 1> grey{0};
        std::ofstream(folder / ("pictures/" + name + ".png"), std::ios::binary)
            << base::greyPng(1, 1, grey, seconds.empty() ? "other" : base::pngTimeKeyword, seconds);
    };
    for (int i = 0; i < 20; ++i) {
        picture(fmt::format("frame_{:05}", i), fmt::format("{:.3f}", 0.5 * i));
    }
    const std::vector<std::string> events{"contact",          "inserted", "fired", "near_the_artery",
                                          "very_near_artery", "out",      "fault"};
    for (std::size_t i = 0; i < events.size(); ++i) {
        picture(fmt::format("{:03}_{}", i, events[i]), fmt::format("{:.3f}", 1.26 * (1.0 + static_cast<double>(i))));
    }
    const auto captions = [&] {
        synthetic::record(folder / "a", synthetic::info(), {});
        writeReport(folder / "r.html", Record(folder / "a"), folder / "pictures");
        std::filesystem::remove(folder / "a");
        std::string html = base::contentOf(folder / "r.html").value(), all;
        for (std::string one; !(one = between(html, "<figcaption>", "</figcaption>")).empty();) {
            html.erase(0, html.find("<figcaption>") + 12);
            all += one + "|";
        }
        return all;
    };
    EXPECT_EQ(captions(),
              "0.0 s|contact, 1.3 s|inserted, 2.5 s|fired, 3.8 s|near the artery, 5.0 s|very near artery, 6.3 s|out, 7.6 "
              "s|fault, 8.8 s|9.5 s|");
    // Of an older viewer, without times: events in their order, then the others.
    picture("002_fired", "");
    EXPECT_EQ(captions(),
              "contact, 1.3 s|inserted, 2.5 s|fired|near the artery, 5.0 s|very near artery, 6.3 s|out, 7.6 "
              "s|fault, 8.8 s|0.0 s|9.5 s|");
}

// Of two sessions one has no value: infinite, and so is what lies between them.
TEST(Report, QuartilesWithoutANumberAreOneDash)
{
    EXPECT_EQ(quartilesText("-", "-", "-"), "-");
    EXPECT_EQ(quartilesText("-", "41.8", "-"), "- (41.8 to -)");
    EXPECT_EQ(quartilesText("2.0", "1.0", "3.0"), "2.0 (1.0 to 3.0)");
}

// On a narrow screen a table in a box of its own is scrolled: its words stay whole.
// Steps of 2 do not move a double of 1e17, whose neighbour is 16 away.
TEST(Report, GroupsOfHugeValuesHaveAnAxis)
{
    std::vector<double> low(haptics::measures().size(), 1e17), high(low.size(), 1e17 + 16);
    const std::string part = groupsPart({{"a", {low, low}}, {"b", {high, high}}});
    EXPECT_NE(part.find(">100000000000000000</text>"), std::string::npos);
}

TEST(Report, WordsOfTablesThatScrollAreNotBroken)
{
    const synthetic::Folder folder;
    synthetic::record(folder / "a", synthetic::info(), synthetic::procedure(5, 0.5, 1));
    writeReport(folder / "r.html", Record(folder / "a"));
    const std::string html = base::contentOf(folder / "r.html").value();
    EXPECT_NE(html.find("<div class=\"scroll\"><table class=\"plain\"><thead><tr><th>Task"), std::string::npos);
    const std::size_t everywhere = html.find("table.plain td { overflow-wrap: anywhere"),
                      scrolled = html.find(".scroll table.plain:not(.facts) td { overflow-wrap: break-word");
    ASSERT_NE(scrolled, std::string::npos);
    EXPECT_LT(everywhere, scrolled) << "the later rule holds";
}

// Each task's row has its own time: task k takes k + 1 us.
TEST(Report, TimesStandBesideTheirTasks)
{
    const synthetic::Folder folder;
    std::vector<haptics::TickRecord> ticks(100);
    for (std::size_t n = 0; n < ticks.size(); ++n) {
        ticks[n].tick = n;
        for (std::size_t k = 0; k < haptics::taskCount; ++k) {
            ticks[n].seconds[k] = static_cast<float>(static_cast<double>(k + 1) * 1e-6);
        }
    }
    synthetic::record(folder / "a", synthetic::info(), ticks);
    writeReport(folder / "r.html", Record(folder / "a"));
    const std::string html = base::contentOf(folder / "r.html").value();
    for (std::size_t k = 0; k < haptics::taskCount; ++k) {
        const std::string code(haptics::taskNames[k]);
        EXPECT_EQ(between(html, "<th>" + code + "</th>", ".0</td>").back(), static_cast<char>('1' + k)) << code;
    }
}

// Energy in mJ as recorded; a touch says how fast it was: the way of one tick times the rate.
TEST(Report, EnergyIsTheRecords)
{
    const synthetic::Folder folder;
    auto ticks = synthetic::procedure(10, 0.3, 1);
    ticks[4000].energy = -0.0125;
    ticks[4000].damped = 0.25;
    synthetic::record(folder / "a", synthetic::info(), ticks);
    writeReport(folder / "r.html", Record(folder / "a"));
    const std::string html = base::contentOf(folder / "r.html").value();
    const auto data = nlohmann::json::parse(between(html, "id=\"data\">", "</script>"));
    const auto& energy = data["charts"]["energy"]["columns"];
    EXPECT_DOUBLE_EQ(std::ranges::min(energy[1].get<std::vector<double>>()), -12.5);
    EXPECT_DOUBLE_EQ(std::ranges::max(energy[2].get<std::vector<double>>()), 250.0);
}

TEST(Report, SessionsWithoutAnythingToShowAreTold)
{
    const synthetic::Folder folder;
    synthetic::record(folder / "none", synthetic::info(), {});
    writeReport(folder / "none.html", Record(folder / "none"));
    EXPECT_NE(base::contentOf(folder / "none.html").value().find("The tool never touched the body."), std::string::npos);
    EXPECT_EQ(base::contentOf(folder / "none.html").value().find("id=\"depth\""), std::string::npos);
    auto ticks = synthetic::procedure(3, 0.5, 1);
    for (auto& tick : ticks) {
        tick.fired = false;
        tick.eventCount = 0;
    }
    synthetic::record(folder / "dry", synthetic::info(), ticks);
    writeReport(folder / "dry.html", Record(folder / "dry"));
    EXPECT_NE(base::contentOf(folder / "dry.html").value().find("The gun was not fired"), std::string::npos);
    EXPECT_NE(base::contentOf(folder / "dry.html").value().find("id=\"depth\""), std::string::npos);
    // Where none is asked for, nothing is missing.
    haptics::SessionInfo touch = synthetic::info();
    touch.sceneText = R"(name = "touch"
task = "touch"
[tool]
kind = "needle"
)";
    synthetic::record(folder / "touch", touch, ticks);
    writeReport(folder / "touch.html", Record(folder / "touch"));
    EXPECT_NE(base::contentOf(folder / "touch.html").value().find("The needle rested on the skin for"), std::string::npos);
    EXPECT_NE(base::contentOf(folder / "touch.html").value().find("<span>Rest on the skin <b>"), std::string::npos);
    EXPECT_EQ(base::contentOf(folder / "touch.html").value().find("The gun was not fired"), std::string::npos);
}

TEST(Report, WithoutScriptsTheReaderLearnsFirstThatChartsAreMissing)
{
    const std::string text = page("t", "<h1>body</h1>", nlohmann::json::object());
    EXPECT_LT(text.find("<noscript><p class=\"warning\">The charts need JavaScript"), text.find("<h1>body</h1>"));
    EXPECT_NE(text.find("<noscript><style>.chart { display: none; }"), std::string::npos);
}

// A card that may not break goes to the next page when it is long, and its heading stays alone; what scrolls is cut off.
TEST(Report, OnPaperNothingScrollsAndNothingIsClosed)
{
    const std::string text = page("t", "", nlohmann::json::object());
    const std::string print = between(text, "@media print {", "</style>");
    EXPECT_NE(print.find(".scroll, pre { overflow: visible; }"), std::string::npos);
    EXPECT_EQ(print.find(".card { break-inside"), std::string::npos);
    EXPECT_NE(print.find(".hint, .u-legend.u-live .u-series:first-child"), std::string::npos);
    EXPECT_NE(between(text, "addEventListener(\"beforeprint\"", "});").find("one.open = true"), std::string::npos);
    EXPECT_NE(between(text, "addEventListener(\"afterprint\"", "});").find("one.open = false"), std::string::npos);
}

TEST(Report, WhatRoundsToZeroHasNoMinus)
{
    haptics::Score score;
    score.tissueWork = -2e-4;  // [J]: prints as 0 mJ, and of groups as -0.2
    const auto lines = haptics::describeMeasures(score);
    const auto work = std::ranges::find(lines, "Work on the tissue", &haptics::LabelledValues::value_type::first);
    ASSERT_NE(work, lines.end());
    EXPECT_EQ(work->second, "0 mJ");
    EXPECT_EQ(cell(-0.04, 1), "0.0");
    EXPECT_EQ(cell(-0.06, 1), "-0.1");
    EXPECT_EQ(deltaText(-0.004), "+0.00");
    EXPECT_EQ(deltaText(-0.25), "-0.25");
}

// The dot plot of a group has little room for its name; the whole name is there to point at.
TEST(Report, NamesThatAreCutOffSaySo)
{
    haptics::Score low, high;
    high.total = 90;
    const std::string part = groupsPart({{"A group with a long name", {rowOf(low)}}, {"b", {rowOf(high)}}});
    EXPECT_NE(part.find(">A group with \u2026<title>A group with a long name</title></text>"), std::string::npos) << part;
}

TEST(Report, RefusesAFolderThatIsNotThereOnOneLine)
{
    const synthetic::Folder folder;
    synthetic::record(folder / "a", synthetic::info(), {});
    const auto html = folder / "no/r.html";
    try {
        writeReport(html, Record(folder / "a"));
        FAIL();
    } catch (const std::runtime_error& e) {
        EXPECT_EQ(e.what(), html.string() + ": cannot be written: check the folder and the space on the disk");
    }
}

}  // namespace
}  // namespace palpate::report
