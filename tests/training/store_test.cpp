#include <base/inputs.h>
#include <datasets/scene.h>
#include <datasets/scene_text.h>
#include <training/store.h>

#include <haptics/record_format.h>
#include <tests/error_of.h>
#include <tests/haptics/synthetic_session.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <map>

namespace palpate::training {
namespace {

namespace fs = std::filesystem;
namespace synthetic = haptics::synthetic;
using haptics::format::Database;
using tests::errorOf;
using tests::Folder;

StoredSession sessionWith(double total, const std::string& started = "2026-11-22T09:00:00Z")
{
    StoredSession s;
    s.started = started;
    s.curriculum = "c";
    s.exercise = "e";
    s.caseId = "near-vessel";
    s.build = "palpate test";
    s.guidance = 0.25;
    s.values = {{"total", total}, {"vital_margin_mm", INFINITY}};
    return s;
}

mode_t modeOf(const fs::path& file)
{
    struct stat s {};
    EXPECT_EQ(::stat(file.c_str(), &s), 0) << file;
    return s.st_mode & 0777;
}

TEST(ProfileStore, GivesBackWhatItWasGiven)
{
    const Folder folder;
    {
        ProfileStore store(folder / "sub/profiles.db");
        const Person anna = store.add("Änna <P-07>", Hand::left);
        StoredSession test = sessionWith(81.25, "2026-11-23T09:00:00Z");
        test.test = true;
        store.store(anna, test);
        store.store(anna, sessionWith(40));
    }
    const ProfileStore store(folder / "sub/profiles.db");
    const Person anna = store.find("Änna <P-07>");
    EXPECT_EQ(anna.hand, Hand::left);
    EXPECT_EQ(anna.sessions, 2);
    const auto sessions = store.sessions(anna);
    ASSERT_EQ(sessions.size(), 2U);
    EXPECT_EQ(sessions[0].values.at("total"), 40) << "by start";
    EXPECT_EQ(sessions[1].values.at("total"), 81.25);
    EXPECT_TRUE(std::isinf(sessions[1].values.at("vital_margin_mm")));
    EXPECT_TRUE(sessions[1].test);
    EXPECT_EQ(sessions[1].guidance, 0.25);
    EXPECT_EQ(sessions[1].caseId, "near-vessel");
    EXPECT_EQ(sessions[1].exercise, "e");
}

TEST(ProfileStore, NobodyElseCanReadItsFiles)
{
    const Folder folder;
    const ::mode_t before = ::umask(0);
    ProfileStore store(folder / "sub/profiles.db");
    store.store(store.add("anna", Hand::right), sessionWith(1));
    EXPECT_EQ(modeOf(folder / "sub"), 0700U);
    EXPECT_EQ(modeOf(folder / "sub/profiles.db"), 0600U);
    EXPECT_EQ(modeOf(folder / "sub/profiles.db-wal"), 0600U);
    store.backup(folder / "backup.db");
    EXPECT_EQ(modeOf(folder / "backup.db"), 0600U);
    ::umask(before);
}

TEST(ProfileStore, RefusesNamesThatAreNone)
{
    const Folder folder;
    ProfileStore store(folder / "p.db");
    store.add("anna", Hand::right);
    EXPECT_NE(errorOf([&] { store.add("anna", Hand::right); }).find("already"), std::string::npos);
    store.add("Jörg Ünal", Hand::right);
    store.add("Ελένη Жук", Hand::right);
    store.add("Արամ", Hand::right);
    for (const char* name : {"Anna", "ANNA", "jörg Ünal", "JÖRG ÜNAL", "ΕΛΈΝΗ ЖУК", "ԱՐԱՄ"}) {
        EXPECT_NE(errorOf([&] { store.add(name, Hand::right); }).find("differs only in capital letters"), std::string::npos)
            << name;
    }
    EXPECT_EQ(errorOf([&] { store.add("Jorg Unal", Hand::right); }), "") << "another letter";
    EXPECT_NE(errorOf([&] { store.add("", Hand::right); }).find("1 to 100 bytes"), std::string::npos);
    EXPECT_NE(errorOf([&] { store.add("a\nb", Hand::right); }).find("one line"), std::string::npos);
    for (const char* const name : {"  ", " bert", "bert "}) {
        EXPECT_NE(errorOf([&] { store.add(name, Hand::right); }).find("begin or end with a blank"), std::string::npos)
            << name;
    }
    EXPECT_NE(errorOf([&] { store.add("-x", Hand::right); }).find("begin with '-'"), std::string::npos);
    EXPECT_NE(errorOf([&] { store.find("ana"); }).find("did you mean anna?"), std::string::npos);
}

// U+200B, U+202E, a blank that does not break, U+0308 behind its letter: on a screen they are names that are there already.
TEST(ProfileStore, RefusesNamesThatLookLikeAnother)
{
    const Folder folder;
    ProfileStore store(folder / "p.db");
    for (const auto& [name, said] : std::map<std::string, std::string>{
             {"an\u200Bna", "character 3, U+200B, cannot be seen"},
             {"\u202Eanna", "character 1, U+202E, cannot be seen"},
             {"anna\U000E0041", "character 5, U+E0041, cannot be seen"},
             {"anna\u00A0b", "character 5, U+00A0, is no plain blank"},
             {"Mu\u0308ller", "character 3, U+0308, is an accent or a sign apart from its letter"},
         }) {
        const std::string error = errorOf([&] { store.add(name, Hand::right); });
        EXPECT_NE(error.find(said), std::string::npos) << error;
        EXPECT_EQ(error.find(name), std::string::npos) << "would turn the line round on a terminal";
    }
    for (const char* const name : {"M\u00FCller", "\u05D3\u05D5\u05D3", "\u0930\u093E\u092E", "\u738B\u82B3", "\uD55C"}) {
        EXPECT_EQ(errorOf([&] { store.add(name, Hand::right); }), "") << name;
    }
}

TEST(ProfileStore, FindsANameThatWouldBeRefusedNow)
{
    const Folder folder;
    ProfileStore(folder / "p.db").add("anna", Hand::left);
    Database((folder / "p.db").string(), SQLITE_OPEN_READWRITE).execute("UPDATE person SET name = 'Mu\u0308ller'");
    EXPECT_EQ(ProfileStore(folder / "p.db").find("Mu\u0308ller").hand, Hand::left);
}

TEST(ProfileStore, ReadingMakesNothing)
{
    const Folder folder;
    const auto store = ProfileStore::toRead(folder / "sub/profiles.db");
    EXPECT_TRUE(store.people().empty());
    EXPECT_EQ(store.file(), folder / "sub/profiles.db");
    EXPECT_NE(errorOf([&] { store.find("anna"); }).find("no such profile"), std::string::npos);
    EXPECT_FALSE(fs::exists(folder / "sub"));
}

/// While it lives, what is forbidden is forbidden to root too.
class Nobody {
public:
    Nobody() { EXPECT_EQ(::geteuid() == 0 ? ::seteuid(65534) : 0, 0); }
    ~Nobody() { EXPECT_EQ(::getuid() == 0 ? ::seteuid(0) : 0, 0); }
    Nobody(const Nobody&) = delete;
    Nobody& operator=(const Nobody&) = delete;
};

// Of version 1 too: it is brought up to date in memory.
TEST(ProfileStore, ReadsWhatCannotBeWritten)
{
    const Folder folder;
    const fs::path sub = folder / "100 % #1?", file = sub / "profiles.db";
    {
        ProfileStore store(file);
        store.store(store.add("anna", Hand::right), sessionWith(40));
    }
    Database(file.string(), SQLITE_OPEN_READWRITE)
        .execute("ALTER TABLE session DROP COLUMN note; ALTER TABLE session DROP COLUMN rating; PRAGMA user_version = 1");
    const std::string before = base::contentOf(file).value();
    fs::permissions(folder.path(), fs::perms(0755));
    fs::permissions(file, fs::perms(0444));
    fs::permissions(sub, fs::perms(0555));
    {
        const Nobody nobody;
        EXPECT_NE(errorOf([&] { ProfileStore{file}; }), "");
        const auto store = ProfileStore::toRead(file);
        ASSERT_EQ(store.people().size(), 1U);
        EXPECT_EQ(store.sessions(store.find("anna")).at(0).values.at("total"), 40);
    }
    fs::permissions(sub, fs::perms(0755));
    EXPECT_EQ(base::contentOf(file).value(), before);
    EXPECT_EQ(std::distance(fs::directory_iterator(sub), fs::directory_iterator()), 1);
}

// The tables of version 1, as released programs would have left them.
TEST(ProfileStore, BringsAnOlderFileUpToDateAndLosesNothing)
{
    const Folder folder;
    {
        ProfileStore store(folder / "p.db");
        store.store(store.add("anna", Hand::right), sessionWith(55));
    }
    {
        Database old((folder / "p.db").string(), SQLITE_OPEN_READWRITE);
        old.execute(
            "ALTER TABLE session DROP COLUMN note; ALTER TABLE session DROP COLUMN rating; PRAGMA user_version = 1");
    }
    ProfileStore store(folder / "p.db");
    const Person anna = store.find("anna");
    const auto sessions = store.sessions(anna);
    ASSERT_EQ(sessions.size(), 1U);
    EXPECT_EQ(sessions[0].values.at("total"), 55);
    EXPECT_EQ(sessions[0].rating, 0);
    store.annotate(anna, sessions[0].id, "calm hands", 4);
    EXPECT_EQ(store.sessions(anna)[0].note, "calm hands");
    EXPECT_NE(errorOf([&] { store.annotate(anna, 99, "", 1); }).find("no session 99"), std::string::npos);
}

TEST(ProfileStore, RefusesWhatItDoesNotKnow)
{
    const Folder folder;
    {
        const ProfileStore store(folder / "new.db");
    }
    {
        Database newer((folder / "new.db").string(), SQLITE_OPEN_READWRITE);
        newer.execute("PRAGMA user_version = 99");
        Database other((folder / "other.db").string(), SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
        other.execute("CREATE TABLE bookmarks (x)");
    }
    EXPECT_NE(errorOf([&] { ProfileStore(folder / "new.db"); }).find("newer Palpate"), std::string::npos);
    const std::string before = base::contentOf(folder / "other.db").value();
    EXPECT_NE(errorOf([&] { ProfileStore(folder / "other.db"); }).find("no file of profiles"), std::string::npos);
    EXPECT_EQ(base::contentOf(folder / "other.db").value(), before);
    std::ofstream(folder / "text.db") << std::string(5000, 'x');
    EXPECT_NE(errorOf([&] { ProfileStore(folder / "text.db"); }), "");
}

TEST(ProfileStore, ErasedIsGoneFromTheBytesToo)
{
    const Folder folder;
    ProfileStore store(folder / "p.db");
    const Person bert = store.add("bert", Hand::right), anna = store.add("Annabella-Secret", Hand::right);
    fs::create_directories(store.recordFolder());
    std::ofstream(store.recordFolder() / "own.db") << "x";
    std::ofstream(folder / "elsewhere.db") << "x";
    StoredSession own = sessionWith(1), other = sessionWith(2);
    own.record = (store.recordFolder() / "own.db").string();
    other.record = (folder / "elsewhere.db").string();
    other.exercise = "exercise-of-Annabella";
    store.store(anna, own);
    store.annotate(anna, store.store(anna, other), "a note on Annabella", 2);
    store.store(bert, sessionWith(3));
    const Erased erased = store.erase(anna);
    ASSERT_EQ(erased.elsewhere.size(), 1U);
    EXPECT_EQ(erased.elsewhere[0], folder / "elsewhere.db");
    EXPECT_FALSE(fs::exists(store.recordFolder() / "own.db"));
    for (const char* file : {"p.db", "p.db-wal"}) {
        EXPECT_EQ(base::contentOf(folder / file).value().find("Annabella"), std::string::npos) << file;
    }
    EXPECT_EQ(store.sessions(store.find("bert")).size(), 1U);
}

// A record as a session leaves it that is killed: a file and its log.
void recordOfKilled(const fs::path& file, const std::string& operatorName)
{
    haptics::SessionInfo info = synthetic::info();
    info.operatorName = operatorName;
    fs::create_directories(file.parent_path());
    const fs::path whole = file.string() + ".whole";
    {
        haptics::Recorder recorder(whole, info);
        recorder.flush();
        for (const char* suffix : {"", "-wal", "-shm"}) {
            fs::copy_file(whole.string() + suffix, file.string() + suffix);
        }
    }
    fs::remove(whole);
}

// Sessions of the window (folder "sessions") and of a terminal ("records"), kept or cut off, with logs, figures and pages.
TEST(ProfileStore, ErasingLeavesNoFileOfThePersonAndAllOfOthers)
{
    const Folder folder;
    ProfileStore store(folder / "p.db");
    const Person anna = store.add("anna", Hand::right), bert = store.add("bert", Hand::right);
    store.add("anna-2", Hand::right);
    const fs::path window = folder / "sessions", records = folder / "records";
    std::vector<fs::path> gone, stay;
    const auto kept = [&](const Person& person, const fs::path& file, const std::string& operatorName) {
        recordOfKilled(file, operatorName);
        StoredSession s = sessionWith(1);
        s.record = file.string();
        store.store(person, s);
    };
    kept(anna, window / "kept.db", "anna");
    kept(anna, window / "pseudonym.db", "P-07");
    kept(bert, window / "of-bert.db", "bert");
    kept(bert, records / "shared.db", "anna");
    for (const char* const name : {"sessions/killed.db", "records/killed.db"}) {
        recordOfKilled(folder / name, "anna");
    }
    for (const char* const name : {"sessions/anna-2.db", "records/berts.db", "sessions/nobodys.db"}) {
        recordOfKilled(folder / name, std::string(name).find("anna") < 20 ? "anna-2" : name[0] == 'r' ? "bert" : "");
    }
    for (const char* const name : {"kept", "pseudonym", "killed", "progress-anna", "of-bert", "anna-2", "nobodys"}) {
        std::ofstream(window / (std::string(name) + ".json")) << "{}";
    }
    for (const char* const name : {"progress-anna.html", "progress-anna-2.html", "groups.html", "damaged.db"}) {
        std::ofstream(window / name) << std::string(5000, 'x');
    }
    fs::create_directories(window / "kept.pictures");
    fs::create_directories(window / "of-bert.pictures");
    for (const char* const name :
         {"kept.mp4", "kept.mp4.part", "kept.pictures/kept.png", "killed.part.mp4", "killed.part.mp4.part", "of-bert.mp4",
          "of-bert.part.mp4.part", "of-bert.pictures/of-bert.png"}) {
        std::ofstream(window / name) << "x";
    }
    for (const auto& entry : fs::recursive_directory_iterator(folder.path())) {
        const std::string name = entry.path().filename().string();
        const bool hers = name.starts_with("kept.") || name.starts_with("pseudonym.") || name.starts_with("killed.") ||
                          name == "progress-anna.html";
        (hers ? gone : stay).push_back(entry.path());
    }
    ASSERT_EQ(gone.size(), 4 * 3 + 3 + 1 + 6U);

    const Erased erased = store.erase(anna);
    for (const fs::path& file : gone) {
        EXPECT_FALSE(fs::exists(file)) << file;
    }
    for (const fs::path& file : stay) {
        EXPECT_TRUE(fs::exists(file)) << file;
    }
    EXPECT_EQ(erased.shared, std::vector<fs::path>{records / "shared.db"});
    EXPECT_EQ(erased.unclear, std::vector<fs::path>{window / "damaged.db"});
    EXPECT_TRUE(erased.elsewhere.empty() && erased.stuck.empty());
    EXPECT_EQ(store.sessions(bert).size(), 2U);
}

// A mistyped name: a file of another kind is refused and stays as it is, a store that others may read does not.
TEST(ProfileStore, OnlyAStoreBecomesPrivate)
{
    const Folder folder;
    const auto modeOf = [](const fs::path& file) { return fs::status(file).permissions() & fs::perms::all; };
    constexpr auto shared = static_cast<fs::perms>(0644), own = static_cast<fs::perms>(0600);
    std::ofstream(folder / "notes.txt") << std::string(5000, 'x');
    recordOfKilled(folder / "r.db", "anna");
    {
        ProfileStore(folder / "p.db").add("anna", Hand::right);
    }
    for (const char* const name : {"notes.txt", "r.db", "p.db"}) {
        fs::permissions(folder / name, shared);
    }
    EXPECT_THROW(ProfileStore(folder / "notes.txt"), std::runtime_error);
    EXPECT_THROW(ProfileStore(folder / "r.db"), std::runtime_error);
    EXPECT_EQ(modeOf(folder / "notes.txt"), shared);
    EXPECT_EQ(modeOf(folder / "r.db"), shared);
    EXPECT_EQ(ProfileStore(folder / "p.db").people().size(), 1U);
    EXPECT_EQ(modeOf(folder / "p.db"), own);
}

// Names that differ in signs only had the same pages in older versions, which then tell of somebody who stays.
TEST(ProfileStore, ErasingKeepsPagesThatTwoPeopleShare)
{
    const Folder folder;
    ProfileStore store(folder / "p.db");
    const Person one = store.add("anna 2", Hand::right);
    store.add("anna-2", Hand::right);
    fs::create_directories(folder / "sessions");
    std::ofstream(folder / "sessions/progress-anna-2.html") << "x";
    EXPECT_EQ(store.erase(one).shared, std::vector<fs::path>{folder / "sessions/progress-anna-2.html"});
    EXPECT_TRUE(fs::exists(folder / "sessions/progress-anna-2.html"));
    EXPECT_TRUE(store.erase(store.find("anna-2")).shared.empty());
    EXPECT_FALSE(fs::exists(folder / "sessions/progress-anna-2.html"));
}

TEST(ProfileStore, TheWindowForgetsOnlyWhoIsErased)
{
    const Folder folder;
    const fs::path settings = folder / "trainer.json";
    std::ofstream(settings) << R"({"person": "anna", "text_scale": 1.5, "later": [1]})";
    forgetLastPerson(settings, "bert");
    EXPECT_NE(base::contentOf(settings).value().find("anna"), std::string::npos);
    forgetLastPerson(settings, "anna");
    const auto left = nlohmann::json::parse(base::contentOf(settings).value());
    EXPECT_EQ(left, (nlohmann::json{{"person", ""}, {"text_scale", 1.5}, {"later", {1}}}));
    forgetLastPerson(folder / "none.json", "anna");
    EXPECT_FALSE(fs::exists(folder / "none.json"));
}

TEST(ProfileStore, ABackupIsTheWholeFile)
{
    const Folder folder;
    ProfileStore store(folder / "p.db");
    const Person anna = store.add("anna", Hand::left);
    store.store(anna, sessionWith(70));
    store.backup(folder / "b.db");
    store.store(anna, sessionWith(71));
    EXPECT_NE(errorOf([&] { store.backup(folder / "b.db"); }).find("exists already"), std::string::npos);
    const ProfileStore copy(folder / "b.db");
    EXPECT_EQ(copy.sessions(copy.find("anna")).size(), 1U);
    EXPECT_EQ(store.exported(anna)["sessions"].size(), 2U);
    EXPECT_EQ(store.exported(anna)["sessions"][1]["measures"]["vital_margin_mm"], "infinite");
}

// As a session says it, else by the scene that it had.
TEST(ProfileStore, GuidanceIsThatOfTheSessionsScene)
{
    datasets::Scene scene = *datasets::builtInScene("layered");
    haptics::SessionInfo info = synthetic::info();
    const auto guidance = [&](datasets::DffbMode mode, double gain) {
        scene.dffb.mode = mode;
        scene.dffb.gain = gain;
        info.sceneText = datasets::sceneText(scene);
        return guidanceIn(info);
    };
    EXPECT_EQ(guidance(datasets::DffbMode::off, 1), 0);
    EXPECT_EQ(guidance(datasets::DffbMode::field, 1), 1);
    EXPECT_EQ(guidance(datasets::DffbMode::thesis, 0.25), 0.25);
    info.extra.emplace_back(guidanceKey, "0.5");
    EXPECT_EQ(guidance(datasets::DffbMode::field, 1), 0.5);
    info.extra.emplace_back(modeKey, "test");
    EXPECT_EQ(guidance(datasets::DffbMode::field, 1), 0);
}

TEST(ProfileStore, TakesARecordInOnceAndNoneThatWasChanged)
{
    const Folder folder;
    haptics::SessionInfo info = synthetic::info();
    info.extra.emplace_back(caseKey, "near-vessel");
    info.extra.emplace_back(exerciseKey, "breast-core-biopsy/near-vessel");
    info.extra.emplace_back(modeKey, "test");
    info.extra.emplace_back(guidanceKey, "0");
    synthetic::record(folder / "s.db", info, synthetic::procedure(4, 0.8, 1));
    const StoredSession s = sessionOf(folder / "s.db");
    EXPECT_EQ(s.curriculum, "breast-core-biopsy");
    EXPECT_EQ(s.exercise, "near-vessel");
    EXPECT_EQ(s.caseId, "near-vessel");
    EXPECT_TRUE(s.test);
    EXPECT_EQ(s.values.at("total"), haptics::scoreOf(haptics::Record(folder / "s.db")).total);
    ProfileStore store(folder / "p.db");
    const Person anna = store.add("anna", Hand::right);
    store.store(anna, s);
    EXPECT_NE(errorOf([&] { store.store(anna, s); }).find("has this session already"), std::string::npos);
    // What the record says is not said otherwise.
    const auto refusal = [&](const Declared& as) {
        return errorOf([&] {
            StoredSession copy = s;
            declare(copy, as);
        });
    };
    EXPECT_NE(refusal({"behind-rib", "", false}).find("says near-vessel"), std::string::npos)
        << refusal({"behind-rib", "", false});
    EXPECT_NE(refusal({"", "breast-core-biopsy/touch", false}).find("says breast-core-biopsy/near-vessel"),
              std::string::npos);
    StoredSession other = s;
    other.caseId = other.curriculum = other.exercise = "";
    other.guidance = 1;
    EXPECT_NE(errorOf([&] {
                  declare(other, {"", "breast-core-biopsy/near-vessel", false});
              }).find("is of the scene"),
              std::string::npos);
    EXPECT_NE(errorOf([&] { declare(other, {"", "", true}); }).find("with guidance"), std::string::npos);
    other.scene = "near-vessel";
    declare(other, {"", "breast-core-biopsy/near-vessel", false});
    EXPECT_EQ(other.caseId, "near-vessel");
    // Nobody has tried who never touched the body.
    auto away = synthetic::procedure(4, 0.8, 1);
    for (haptics::TickRecord& tick : away) {
        tick.phase = haptics::Phase::free;
        tick.eventCount = 0;
    }
    synthetic::record(folder / "away.db", info, away);
    EXPECT_NE(errorOf([&] { sessionOf(folder / "away.db"); }).find("never touched"), std::string::npos);
    {
        Database record((folder / "s.db").string(), SQLITE_OPEN_READWRITE);
        record.execute("UPDATE session SET value = 'expert' WHERE key = 'operator'");
    }
    EXPECT_NE(errorOf([&] { sessionOf(folder / "s.db"); }).find("was changed"), std::string::npos);
}

}  // namespace
}  // namespace palpate::training
