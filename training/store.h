#pragma once

#include <haptics/recorder.h>
#include <haptics/score.h>
#include <training/gate.h>

#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace palpate::haptics::format {
class Database;
}

namespace palpate::training {

enum class Hand : std::uint8_t { right, left };
inline const char* nameOf(Hand hand) noexcept
{
    return hand == Hand::left ? "left" : "right";
}

/// Somebody who trains. The name may be a pseudonym.
struct Person {
    std::int64_t id = 0;
    std::string name;
    Hand hand = Hand::right;
    std::string created;  // UTC, "2026-11-22T09:14:05Z"
    int sessions = 0;     // stored
};

/// A session as it is kept: what it was, and all its measures.
struct StoredSession {
    std::int64_t id = 0;
    std::string started;               // UTC, "2026-11-22T09:14:05Z"
    std::string caseId;                // empty: none
    std::string curriculum, exercise;  // empty: outside one
    bool test = false;                 // test mode; else practice
    double guidance = 1;               // fraction of the guiding force, 0 to 1
    std::string scene, device, build;
    std::string record;        // file; empty: none was kept
    std::string recordSha256;  // its seal; empty: none
    bool taken = false;        // taken in from a record afterwards, not stored by the session itself
    Values values;             // all measures, by key; those without a value are missing
    std::string note;          // of an instructor
    int rating = 0;            // global rating, 1 to 5; 0: none
};

/// What is left of somebody who was erased.
struct Erased {
    std::vector<std::filesystem::path> elsewhere;  // records in other folders
    std::vector<std::filesystem::path> shared;     // of other people too
    std::vector<std::filesystem::path> unclear;    // cannot be read: whose they are is not known
    std::vector<std::filesystem::path> stuck;      // could not be removed
};

/// All measures of a score, as a store keeps them. Infinite ones stay; what is not a number is left out.
Values valuesOf(const haptics::Score& score);

/// The keys in SessionInfo::extra under which a record says what its session was trained for.
inline constexpr const char* caseKey = "case";
inline constexpr const char* exerciseKey = "exercise";  // "CURRICULUM/EXERCISE"
inline constexpr const char* modeKey = "mode";          // "practice" or "test"
inline constexpr const char* handKey = "hand";          // "left" or "right"
inline constexpr const char* guidanceKey = "guidance";  // 0 to 1

/// People and their sessions in one SQLite file of mode 0600. Every change is one transaction, which is on the disk when
/// the call returns; a process that is killed leaves all of it or nothing. Several processes may have it open. All calls
/// throw std::runtime_error ("FILE: what is wrong and what to do").
class ProfileStore {
public:
    /// Opens the file, or makes it and its folder (mode 0700). One of an older version is brought up to date in one
    /// transaction; one of a newer version, or of another program, is refused.
    /// @param file  empty: the standard one
    explicit ProfileStore(const std::filesystem::path& file);
    /// Opens the file for reading, and makes none: one that is not there has nobody. One that cannot be written, or whose
    /// folder cannot, also because the disk is full, is read as it is at this moment.
    static ProfileStore toRead(const std::filesystem::path& file);
    ~ProfileStore();
    ProfileStore(ProfileStore&&) noexcept;

    /// $XDG_DATA_HOME/palpate/profiles.db, see userData().
    static std::filesystem::path standardFile();
    const std::filesystem::path& file() const noexcept { return file_; }
    /// The folder "records" beside the file, where sessions of profiles keep their records.
    std::filesystem::path recordFolder() const { return file_.parent_path() / "records"; }
    /// The folder "sessions" beside the file, where the trainer's window keeps records and figures.
    std::filesystem::path windowFolder() const { return file_.parent_path() / "sessions"; }

    /// @param name  1 to 100 bytes of text in one line; none that is there
    Person add(const std::string& name, Hand hand);
    std::vector<Person> people() const;
    /// Refuses a name that is not there, with the nearest that is.
    Person find(const std::string& name) const;

    void setHand(const Person& person, Hand hand);

    /// @returns  the session's id
    std::int64_t store(const Person& person, const StoredSession& session);
    /// By start.
    std::vector<StoredSession> sessions(const Person& person) const;
    /// An instructor's words and global rating (1 to 5; 0: none) of a session of this person.
    void annotate(const Person& person, std::int64_t session, const std::string& note, int rating);

    /// Everything that is known of a person.
    nlohmann::json exported(const Person& person) const;
    /// Removes a person, all sessions and notes, so that nothing of it is left in the file, and what recordFolder() and
    /// windowFolder() hold of the person: records of its sessions and those whose operator it is, also of sessions that
    /// were cut off, with their logs and figures.
    Erased erase(const Person& person);
    /// A copy of the whole file as it is at one moment, also while sessions are stored. Appears whole, mode 0600; refuses a
    /// file that is there.
    void backup(const std::filesystem::path& to) const;

private:
    ProfileStore() = default;
    static std::filesystem::path placeOf(const std::filesystem::path& file);
    void open(const std::string& name);
    std::set<std::filesystem::path> recordsOf(const Person& person) const;
    void emptyLog();

    std::filesystem::path file_;
    std::unique_ptr<haptics::format::Database> database_;
};

/// Clears who trained last in the settings of the trainer's window, where it is this person. Throws std::runtime_error.
void forgetLastPerson(const std::filesystem::path& settings, const std::string& name);

/// The fraction of the guiding force, 0 to 1, of a session: as it says, else by its scene; 0 in a test.
/// Throws std::runtime_error for a scene that cannot be read.
double guidanceIn(const haptics::SessionInfo& info);

/// Takes in a session from its record, e.g. from another machine: measures computed from the ticks, what it was trained for
/// from the record. Throws std::runtime_error for a record that was changed or not closed, and for a session that would not
/// have counted: without a touch of the body, or with a fault.
StoredSession sessionOf(const std::filesystem::path& record);

/// What somebody says that a session was, where its record does not say it.
struct Declared {
    std::string caseId;    // empty: as in the record
    std::string exercise;  // CURRICULUM/EXERCISE; empty: as in the record
    bool test = false;
};
/// Throws std::runtime_error where the record says otherwise: another case or exercise, another scene, or guidance in a
/// test.
void declare(StoredSession& session, const Declared& as);

}  // namespace palpate::training
