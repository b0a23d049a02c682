#pragma once

#include <haptics/tick.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace palpate::haptics {

/// What a record says about its session.
struct SessionInfo {
    std::string scene;         // name
    std::string sceneText;     // TOML, enough to build the same session again
    std::string sceneOrigin;   // file that the text came from; relative paths start at its folder
    std::string volumeHash;    // of the labels, so that replay can refuse another volume
    std::string model;         // "chainmail", ..
    std::string device;        // "hand", ..
    std::string build;         // version and commit
    std::string name;          // of the session, under which viewers found it
    std::string operatorName;  // or pseudonym of who held the device; empty: not said
    std::string host;          // machine
    std::string started;       // date and time, UTC: "2026-11-21T14:03:07Z"
    double rate = 1000;        // [Hz]
    std::uint64_t seed = 1;
    std::vector<std::string> structures;  // target first, then vital structures
    bool probe = false;                   // the scene holds an ultrasound probe
    std::vector<std::string> tissues;     // rows of the tissue table
    std::vector<double> warnDistances;    // by structure [m]; 0 for the target
    std::vector<std::pair<std::string, std::string>> extra;

    /// Value of a key of `extra`; empty where it is not there.
    [[nodiscard]] std::string extraOf(std::string_view key) const;
};

/// Whether a record is what its writer closed.
struct Seal {
    enum class State {
        open,    // it was never closed: its session was cut off or still runs
        absent,  // of a format that had no seals
        whole,
        broken,
    };
    State state = State::open;
    std::string sha256;                // of the whole record, as it was sealed; empty where it was not
    std::vector<std::string> changed;  // what is not what was written, in words: "session.operator is gone"
};

/// Why no record can get this name, to be put behind "FILE: "; empty: it can. The name is also taken where the log of a
/// record lies that was moved without it: most of an interrupted session is in its log.
[[nodiscard]] std::string nameTaken(const std::filesystem::path& file);

/// Writes a session to one SQLite file (WAL). The servo thread pushes, a thread of the recorder's own writes in batches, so
/// that a kill at any moment loses at most 0.5 s.
class Recorder {
public:
    /// Throws std::runtime_error when the file cannot be made or its name is taken, and for a session that no record holds:
    /// a rate outside 100 Hz to 20 kHz, more structures or tissues than there may be, names of over 200 bytes, a key of
    /// `extra` that is there twice.
    Recorder(const std::filesystem::path& file, const SessionInfo& info);
    /// Writes what is left, marks the session complete and leaves one plain file, as finish() does.
    ~Recorder();

    /// From one thread. Wait-free, allocates nothing; a full ring counts a lost record. A tick that no Record would read,
    /// as one with a tip beyond 10 m, ends the record before it, and error() says why.
    void push(const TickRecord& record) noexcept;
    /// Waits until everything pushed so far is in the file. For sessions that run faster than real time, so that the ring
    /// does not fill; never from a real-time loop.
    void flush();
    /// From the setting-up thread, after the servo loop has ended: writes what is left and key-value results, such as the
    /// score, marks the session complete and folds the log into the file, so that it is one plain file. Where a viewer
    /// reads it then, the log stays until the viewer ends.
    void finish(const std::vector<std::pair<std::string, std::string>>& results);
    std::uint64_t lost() const noexcept;
    /// Empty, or what went wrong in writing (a full disk, a file that was removed or moved, no room for one plain file; the
    /// latter two after finish()): the session goes on, and the user is told at its end.
    std::string error() const;
    /// Whether the record holds every tick; with its log beside it, where error() says that there was no room to fold it.
    bool whole() const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// A record opened for reading; also one whose writer was killed. A file from anywhere: what it holds is checked before it
/// is handed out. Poses are poses, forces that were sent are finite and at most 1 kN, indices are of structures and tissues
/// that the record has, shares are between 0 and 1; rows of events and cores are of ticks that are there.
class Record {
public:
    /// Throws std::runtime_error ("FILE: what is wrong and what to do").
    explicit Record(const std::filesystem::path& file);
    Record(Record&&) noexcept;
    ~Record();

    const std::string& file() const noexcept;  // where it is, for messages
    const SessionInfo& info() const noexcept;
    bool complete() const noexcept;  // false when the writer was killed
    int format() const noexcept;     // version of the file's tables: 2 to 5
    /// Computes the digests of all tables again: reads the whole file.
    Seal seal() const;
    std::uint64_t ticks() const;
    /// Calls `visit` for every tick in order, with events and cores filled in.
    void each(const std::function<void(const TickRecord&)>& visit) const;
    /// As each(), for as long as `visit` says so; what comes behind is not read.
    void eachWhile(const std::function<bool(const TickRecord&)>& visit) const;
    std::vector<std::pair<std::string, std::string>> results() const;
    /// Of one key; empty where there is none.
    std::string result(std::string_view key) const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::haptics
