#include <training/store.h>

#include <haptics/record_format.h>
#include <tests/error_of.h>
#include <tests/haptics/synthetic_session.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sys/stat.h>

#include <fstream>
#include <iterator>

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

std::string bytesOf(const fs::path& file)
{
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
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
    EXPECT_NE(errorOf([&] { store.add("", Hand::right); }).find("1 to 100 bytes"), std::string::npos);
    EXPECT_NE(errorOf([&] { store.add("a\nb", Hand::right); }).find("one line"), std::string::npos);
    EXPECT_NE(errorOf([&] { store.find("ana"); }).find("did you mean anna?"), std::string::npos);
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
    const std::string before = bytesOf(folder / "other.db");
    EXPECT_NE(errorOf([&] { ProfileStore(folder / "other.db"); }).find("no file of profiles"), std::string::npos);
    EXPECT_EQ(bytesOf(folder / "other.db"), before);
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
    const auto stay = store.erase(anna);
    ASSERT_EQ(stay.size(), 1U);
    EXPECT_EQ(stay[0], folder / "elsewhere.db");
    EXPECT_FALSE(fs::exists(store.recordFolder() / "own.db"));
    for (const char* file : {"p.db", "p.db-wal"}) {
        EXPECT_EQ(bytesOf(folder / file).find("Annabella"), std::string::npos) << file;
    }
    EXPECT_EQ(store.sessions(store.find("bert")).size(), 1U);
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
    {
        Database record((folder / "s.db").string(), SQLITE_OPEN_READWRITE);
        record.execute("UPDATE session SET value = 'expert' WHERE key = 'operator'");
    }
    EXPECT_NE(errorOf([&] { sessionOf(folder / "s.db"); }).find("was changed"), std::string::npos);
}

}  // namespace
}  // namespace palpate::training
