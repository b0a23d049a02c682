#include <tests/apps/program.h>

#include <gtest/gtest.h>

#include <regex>

namespace palpate::apps {
namespace {

using Words = std::vector<std::string>;

TEST(CommandLine, EveryCommandExplainsItself)
{
    const std::vector<Words> commands{
        {},        {"train"}, {"import"},        {"info"},           {"phantom"},         {"replay"},
        {"score"}, {"bench"}, {"bench", "tick"}, {"bench", "query"}, {"bench", "kernel"}, {"plan"},
        {"press"}};
    for (Words words : commands) {
        words.push_back("--help");
        const Outcome outcome = palpate(words);
        EXPECT_EQ(outcome.status, 0) << words[0];
        EXPECT_NE(outcome.out.find("Usage: palpate"), std::string::npos) << outcome.out;
        EXPECT_EQ(outcome.err, "");
    }
    EXPECT_EQ(palpate({"version"}).out, palpate({"--version"}).out);
    EXPECT_EQ(palpate({"help"}).out, palpate({"--help"}).out);
    EXPECT_EQ(palpate({"help", "bench", "tick"}).out, palpate({"bench", "tick", "--help"}).out);
}

// Libraries start their threads before main(): the program was aborted.
TEST(CommandLine, WithoutThreadsItSaysSoOnOneLine)
{
    // The limit does not hold for root.
    const std::string limited =
        "palpate=$1; shift; if [ \"$(id -u)\" = 0 ]; then exec setpriv --reuid=65534 --regid=65534 "
        "--clear-groups prlimit --nproc=1 \"$palpate\" \"$@\"; fi; "
        "ulimit -u 1; exec \"$palpate\" \"$@\"";
    const Outcome outcome =
        Program("/bin/bash", {"-c", limited, "bash", PALPATE_BIN_DIR "/palpate", "info", "--help"}).wait();
    EXPECT_EQ(outcome.status, 1);
    EXPECT_EQ(outcome.err,
              "palpate: no thread can be started (Resource temporarily unavailable): end other programs, or "
              "allow more (ulimit -u)\n");
}

TEST(CommandLine, VersionSaysBuildKernelSetsAndLibraries)
{
    const Outcome said = palpate({"--version"});
    EXPECT_EQ(said.status, 0);
    const auto trained = figures({"train", smallLayered(), "--headless", "--unpaced", "--seconds", "0.001"});
    EXPECT_EQ(said.out.substr(0, said.out.find('\n')), trained.at("build").get<std::string>());
    EXPECT_TRUE(
        std::regex_search(said.out, std::regex("\nkernels +x86-64-v2, AVX2, AVX-512 \\(this machine runs x86-64-v2")));
    for (const std::string library : {"OpenVDB 1", "SQLite 3.", "OpenSSL 3.", "DCMTK 3.", "TBB 20", "CLI11 2."}) {
        EXPECT_NE(said.out.find(library), std::string::npos) << library;
    }
}

TEST(CommandLine, TheHelpListsEveryCommand)
{
    const std::string help = palpate({"--help"}).out;
    for (const std::string command : {"train", "import", "info", "phantom", "replay", "score", "plan", "press", "bench"}) {
        EXPECT_NE(help.find("\n  " + command + " "), std::string::npos) << command;
    }
}

TEST(CommandLine, WhatIsNotThereIsRefusedOnOneLine)
{
    expectRefusal({}, "--help");
    expectRefusal({"nosuch"}, "nosuch: there is no such command");
    expectRefusal({"trian"}, "trian: there is no such command or option; did you mean train?");
    expectRefusal({"bench", "nosuch"}, "nosuch: there is no such command");
    expectRefusal({"case", "lisst"}, "lisst: there is no such command or option; did you mean list?");
    EXPECT_EQ(palpate({"case", "info", "x"}).err.find("did you mean info"), std::string::npos);
    expectRefusal({"train", "--nosuch"}, "--nosuch (see palpate train --help)");
    expectRefusal({"profile", "new"}, "NAME is required (see palpate profile new --help)");
    expectRefusal({"train", "--model", "nosuch"}, "nosuch");
    expectRefusal({"bench", "tick", "--model", "nosuch"}, "nosuch");
    expectRefusal({"bench", "tick", "--voxels", "0"}, "--voxels");
    for (const std::vector<std::string>& bench : {std::vector<std::string>{"tick", "nix.toml"},
                                                  {"kernel", "--scenes", "block,foo"},
                                                  {"kernel", "--volume", "nix.vdb"}}) {
        std::vector<std::string> words{"bench"};
        words.insert(words.end(), bench.begin(), bench.end());
        EXPECT_EQ(palpate(words).out, "") << "a heading of nothing: " << bench.back();
        expectRefusal(words, "no such");
    }
    for (const std::string size : {"10", "0x0", "319x320", "99999x99999", "640x480x2"}) {
        expectRefusal({"bench", "sync", "--size", size},
                      "--size " + size + ": must be WIDTHxHEIGHT, each side 320 to 8192");
    }
    expectRefusal({"train", "--setting", "nosuch"}, "nosuch");
    expectRefusal({"train", "block", "--headless", "--model", "spring", "--setting", "fine"},
                  "block: the tissue model is spring: --setting changes nothing");
    for (const std::string seconds : {"soon", "-1", "nan", "inf", "86401"}) {
        expectRefusal({"train", "--seconds", seconds}, "--seconds: " + seconds + ": must be 0 to 86400 s");
    }
    for (const std::string seed :
         {"-1", "-0", "1.5", "x", "9223372036854775808", "18446744073709551615", "99999999999999999999999"}) {
        const std::string why = "--seed: " + seed + ": must be a whole number from 0 to 9223372036854775807";
        expectRefusal({"train", "--seed", seed}, why);
        expectRefusal({"phantom", "breast", "--seed", seed, "-o", "never.vdb"}, why);
        expectRefusal({"scene", "v.vdb", "--lesion-in", "fat", "--seed", seed, "-o", "never.toml"}, why);
        expectRefusal({"curriculum", "verify", "breast-core-biopsy", "--seed", seed}, why);
        expectRefusal({"stability", "--seed", seed}, why);
        expectRefusal({"bench", "tasks", "--seed", seed}, why);
    }
    expectRefusal({"bench"}, "--help");
    expectRefusal({"train", "nosuch"}, "layered, block, plate, pair");
    expectRefusal({"phantom", "nosuch", "-o", "never.vdb"}, "breast, layered, block");
    expectRefusal({"train", "layered", "--headless", "--target", "nosuch"}, "nosuch");
}

// What is quoted may be anything: a message remains one line, and works no terminal.
TEST(CommandLine, ANameOfSeveralLinesIsQuotedOnOne)
{
    expectRefusal({"score", "a\nb.db"}, "a\\nb.db: there is no such file: check the name");
    expectRefusal({"train", "--case", "no\tsuch\x1b[2J"}, "no\\tsuch\\x1b[2J: there is no such case");
    expectRefusal({"train", "--no\nsuch"}, "--no\\nsuch (see palpate train --help)");
}

TEST(CommandLine, ARecordOrALabelMapInPlaceOfASceneIsNamed)
{
    const Folder folder;
    const std::string record = folder / "s.db", labels = folder / "seg.nii.gz", volume = folder / "seg.nrrd";
    for (const std::string& file : {record, labels, volume}) {
        writeText(file, "not read");
    }
    expectRefusal({"train", record, "--headless"}, record + ": is no scene: a record is shown by 'palpate-view --replay'");
    for (const std::string& file : {labels, volume}) {
        expectRefusal({"train", file, "--headless"}, file + ": is no scene: 'palpate import' makes a volume");
        expectRefusal({"press", file, "--path", "p.csv"}, file + ": is no scene: 'palpate import' makes a volume");
    }
}

TEST(CommandLine, ALinkThatLeadsBackToItselfIsRefusedLikeAnyFileThatCannotBeRead)
{
    const Folder folder;
    const std::string volume = folder / "loop.vdb", scene = folder / "loop.toml", bare = folder / "loop";
    for (const std::string& link : {volume, scene, bare}) {
        std::filesystem::create_symlink(link, link);
    }
    const std::string why = ": is a symbolic link that leads back to itself: name the file itself";
    writeText(folder / "p.csv", "x_mm,y_mm,z_mm\n0,0,0\n");
    expectRefusal({"info", volume}, volume + why);
    expectRefusal({"export", volume, "-o", folder / "x.nrrd"}, volume + why);
    for (const std::string& file : {volume, scene, bare}) {
        expectRefusal({"press", file, "--path", folder / "p.csv"}, file + why);
        expectRefusal({"train", file, "--headless"}, file + why);
    }
    expectRefusal({"train", "--case", bare, "--headless"}, bare + ": there is no such case");
    expectRefusal({"train", "block", "--headless", "--unpaced", "--record", bare}, bare + why);
}

// A variable of a shell that is not set: what was asked for would not be written, and nobody would be told.
TEST(CommandLine, AnOptionWithAnEmptyValueIsRefused)
{
    for (const std::string option : {"--json", "--report", "--record", "--pictures", "--seconds", "--setting"}) {
        expectRefusal({"train", "block", "--headless", "--unpaced", option, ""}, option + ": the value is empty: give one");
    }
    const Folder folder;
    writeText(folder / "p.csv", "x_mm,y_mm,z_mm\n0,0,0\n");
    for (const std::string option : {"--csv", "--json", "--at"}) {
        expectRefusal({"press", "block", "--path", folder / "p.csv", option, ""}, option + ": the value is empty");
    }
    // Of any bound a comparison with it is false.
    expectRefusal({"accuracy", "--limit", "nan"}, "--limit: nan: must be a number");
    expectRefusal({"press", "block", "--csv=", "--path", folder / "p.csv"}, "--csv: the value is empty");
    expectRefusal({"train", "block", "--headless="},
                  "The following argument was not expected: \"\"; an option that takes no value has no =");
    const Outcome viewer = Program("palpate-view", {"--json", ""}).wait();
    EXPECT_EQ(viewer.status, 2);
    EXPECT_EQ(viewer.err.find("palpate-view: --json: the value is empty"), 0U) << viewer.err;
}

// As `palpate export --at` takes them; a number alone is in seconds.
TEST(CommandLine, TheViewerTakesTimesWithTheirUnits)
{
    const Folder folder;
    const std::string none = folder / "none.db";
    const auto ended = [&](const std::string& at) {
        return Program("palpate-view", {"--replay", none, "--at", at}).wait().err;
    };
    for (const std::string at : {"3", "3s", "3200ms", "0s", "86400"}) {
        EXPECT_EQ(ended(at).find("palpate-view: " + none), 0U) << ended(at);
    }
    for (const std::string option : {"--every", "--wait"}) {
        const auto said = Program("palpate-view", {"--replay", none, option, "nan"}).wait().err;
        EXPECT_EQ(said, "palpate-view: " + option + ": nan: must be a number (see palpate-view --help)\n");
    }
    for (const std::string at : {"3m", "s", "-1s", "nan", "nans", "90000s"}) {
        EXPECT_EQ(ended(at).find("palpate-view: --at: "), 0U) << ended(at);
    }
}

// A name that was typed twice replaced the path, the segmentation, the volume, the record or all profiles by the output.
TEST(CommandLine, AFileThatIsReadIsNotReplacedByWhatIsWritten)
{
    const Folder folder;
    const std::string path = folder / "p.csv", volume = folder / "v.vdb", labels = folder / "l.nii.gz";
    const std::string record = folder / "s.db", profiles = folder / "profiles.db";
    writeText(path, "seconds,x_mm,y_mm,z_mm\n0,0,-12,0\n0.1,0,-12,0\n");
    ASSERT_EQ(palpate({"phantom", "layered", "--voxel", "3", "-o", volume}).status, 0);
    ASSERT_EQ(palpate({"export", volume, "-o", labels}).status, 0);
    ASSERT_EQ(palpate({"train", smallLayered(), "--headless", "--unpaced", "--setting", "fast", "--seconds", "0.1",
                       "--record", record})
                  .status,
              0);
    ASSERT_EQ(palpate({"profile", "new", "ann", "--profiles", profiles}).status, 0);
    const std::vector<std::pair<std::string, Words>> commands{
        {path, {"press", "block", "--setting", "fast", "--path", path, "--csv", path}},
        {labels, {"import", labels, "--write-map", labels}},
        {volume, {"scene", volume, "-o", volume}},
        {volume, {"export", volume, "-o", labels, "--write-map", volume}},
        {record, {"score", record, "--report", record}},
        {record, {"replay", record, "--json", record}},
        {profiles, {"profile", "export", "ann", "--profiles", profiles, "-o", profiles}},
        {profiles, {"progress", "ann", "--profiles", profiles, "--csv", profiles}}};
    for (const auto& [file, words] : commands) {
        const auto before = std::filesystem::file_size(file);
        expectRefusal(words, file + ": is a file that is read, and would be replaced");
        EXPECT_EQ(std::filesystem::file_size(file), before);
    }
    const std::string twice = folder / "twice";
    expectRefusal({"press", "block", "--path", path, "--csv", twice, "--json", twice}, twice + ": would be written twice");
    const Outcome viewer =
        Program("palpate-view", {"--replay", record, "--offscreen", folder / "p", "--json", record}).wait();
    EXPECT_NE(viewer.status, 0);
    EXPECT_NE(viewer.err.find(record + ": is a file that is read"), std::string::npos) << viewer.err;
}

TEST(CommandLine, AMissingFileIsRefusedOnOneLine)
{
    const Folder folder;
    const std::string none = folder / "none";
    expectRefusal({"info", none + ".vdb"}, none + ".vdb: ");
    expectRefusal({"train", none + ".vdb", "--headless"}, none + ".vdb: ");
    expectRefusal({"train", none + ".toml", "--headless"}, none + ".toml: ");
    expectRefusal({"train", "layered", "--headless", "--device", none + ".db"}, none + ".db: ");
    expectRefusal({"import", none + ".nii", "-o", none + ".vdb"}, none + ".nii: ");
    expectRefusal({"replay", none + ".db"}, none + ".db: ");
    expectRefusal({"score", none + ".db"}, none + ".db: ");
}

TEST(CommandLine, AFolderInPlaceOfAFileIsRefusedOnOneLine)
{
    const Folder folder;
    const std::string inside = folder / "sub.vdb";
    std::filesystem::create_directory(inside);
    expectRefusal({"info", inside}, inside + ": is a folder");
    expectRefusal({"train", inside, "--headless"}, inside + ": is a folder");
    expectRefusal({"train", folder / "", "--headless"}, "is a folder");
    expectRefusal({"import", inside, "-o", folder / "out.vdb"}, inside + ": ");
    expectRefusal({"replay", inside}, inside + ": ");
    expectRefusal({"score", inside}, inside + ": ");
    expectRefusal({"phantom", "block", "-o", inside}, inside + ": ");
}

TEST(CommandLine, AFileOfAnotherKindIsRefusedOnOneLine)
{
    const Folder folder;
    const std::string text = folder / "letter.vdb";
    writeText(text, "Dear reader,\n");
    expectRefusal({"info", text}, text + ": ");
    expectRefusal({"import", text, "-o", folder / "out.vdb"}, text + ": ");
    expectRefusal({"replay", text}, text + ": ");
    EXPECT_FALSE(std::filesystem::exists(folder / "out.vdb"));
}

TEST(CommandLine, AnOutputThatCannotBeWrittenIsRefusedOnOneLine)
{
    const Folder folder;
    const std::string file = folder / "file", below = file + "/figures";
    writeText(file, "not a folder");
    const Words session{"train", smallLayered(), "--headless", "--unpaced", "--seconds", "0.1"};
    for (const std::string option : {"--json", "--record", "--report"}) {
        Words words = session;
        words.insert(words.end(), {option, below + ".db"});
        expectRefusal(words, below);
    }
    expectRefusal({"phantom", "block", "-o", below + ".vdb"}, below);
    expectRefusal({"phantom", "block", "-o", folder / "block.vdb", "--json", below}, below);
    EXPECT_FALSE(std::filesystem::exists(folder / "block.vdb")) << "what cannot be written is looked at first";
    ASSERT_EQ(palpate({"phantom", "block", "--voxel", "4", "-o", folder / "block.vdb"}).status, 0);
    expectRefusal({"info", folder / "block.vdb", "--json", below}, below);
}

// The scene is wrong, too: the output is looked at first, and nothing is lost that took time.
TEST(CommandLine, AnOutputThatCannotBeWrittenIsRefusedBeforeTheSession)
{
    const Folder folder;
    const std::string file = folder / "file";
    writeText(file, "not a folder");
    for (const std::string option : {"--json", "--record", "--report", "--pictures"}) {
        expectRefusal({"train", "nosuch", option, file + "/a.html"}, file + "/a.html: cannot be ");
        expectRefusal({"train", "nosuch", option, folder / "none/.."}, option == "--pictures" ? "nosuch: " : "/none/..: ");
    }
    expectRefusal({"train", "nosuch", "--report", folder / "a.db"}, "call the report .html");
    writeText(folder / "b.db", "mine");
    expectRefusal({"train", "nosuch", "--report", folder / "b.html"}, "b.db: exists already");
    expectRefusal({"train", "nosuch", "--json", folder / ""}, "is a folder");
}

TEST(CommandLine, ASeedForAVolumeIsRefused)
{
    const Folder folder;
    const std::string volume = folder / "block.vdb", scene = folder / "scene.toml";
    ASSERT_EQ(palpate({"phantom", "block", "--voxel", "4", "-o", volume}).status, 0);
    writeText(scene, "[volume]\nfile = \"block.vdb\"\n[target]\nstructure = \"tumour\"\n");
    for (const std::string& what : {volume, scene}) {
        expectRefusal({"train", what, "--headless", "--seed", "2"}, what + ": the volume is no phantom: --seed");
    }
}

// Standard output is one JSON text and nothing else.
TEST(CommandLine, FiguresOnStandardOutputStandAlone)
{
    const Folder folder;
    const std::string record = folder / "session.db", report = folder / "report.html", volume = folder / "block.vdb";
    const std::vector<Words> commands{
        {"train", smallLayered(), "--headless", "--unpaced", "--seconds", "0.1", "--record", record, "--report", report},
        {"replay", record},
        {"score", record, "--group", "all=" + record},
        {"bench", "tick", "layered", "--model", "spring", "--voxels", "32"},
        {"bench", "query", "--elements", "32"},
        {"phantom", "block", "--voxel", "4", "-o", volume},
        {"info", volume}};
    for (Words words : commands) {
        words.insert(words.end(), {"--json", "-"});
        const Outcome outcome = palpate(words);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        EXPECT_TRUE(nlohmann::json::accept(outcome.out)) << words[0] << " printed:\n" << outcome.out;
    }
}

// A study's guidance: whole in the first trial, none in the last, and nothing else changes what is felt of the tissue.
TEST(CommandLine, GuidanceFadesOverTheTrialsOfAStudy)
{
    const auto peaks = [](const Words& more) {
        Words words{"train", smallLayered(), "--headless", "--unpaced", "--seconds",
                    "1.2",   "--model",      "chainmail",  "--json",    "-"};
        words.insert(words.end(), more.begin(), more.end());
        const Outcome outcome = palpate(words);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return nlohmann::json::parse(outcome.out).at("peak_force_n");
    };
    const auto whole = peaks({"--dffb", "on"}), first = peaks({"--dffb", "fade", "--trial", "1/5"});
    const auto last = peaks({"--dffb", "fade", "--trial", "5/5"});
    EXPECT_GT(whole.at("additional"), 0.0);
    EXPECT_EQ(first.at("additional"), whole.at("additional"));
    EXPECT_EQ(last.at("additional"), 0.0);
    for (const char* trial : {"6/5", "0/5", "1/1", "2", "2/5x"}) {
        expectRefusal({"train", "layered", "--headless", "--dffb", "fade", "--trial", trial},
                      std::string("--trial ") + trial + ": must be K/N");
    }
    expectRefusal({"train", "layered", "--headless", "--trial", "1/5"}, "--trial: ");
}

TEST(CommandLine, AWrongValueInASceneIsNamedByFileAndLine)
{
    const Folder folder;
    const std::string scene = folder / "scene.toml";
    const std::string good = "[volume]\nphantom = \"layered\"\n[target]\nstructure = \"tumour\"\n[dffb]\n";
    writeText(scene, good + "range_mm = -4\n");
    expectRefusal({"train", scene, "--headless"}, scene + ":6: [dffb] range_mm = -4 mm");
    writeText(scene, good + "rang_mm = 4\n");
    expectRefusal({"train", scene, "--headless"}, scene + ":6: ");
    writeText(scene, good + "[model\n");
    expectRefusal({"train", scene, "--headless"}, scene + ":6: ");
    writeText(scene, good + "range_mm = 4\n");
    EXPECT_EQ(palpate({"train", scene, "--headless", "--unpaced", "--seconds", "0.05"}).status, 0);
}

}  // namespace
}  // namespace palpate::apps
