#pragma once

#include <trainer/state.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace palpate::trainer {

/// What `palpate train --json` wrote. A file that is not there or says no score is a result with a problem.
Result readResult(const std::filesystem::path& figures);
/// A person who was erased while the session ran has lost its record, and is to leave no figures: removes them, and says it
/// in place of a result. False where the record is there, or there is no score.
/// @param ran  the session still ran then; else it was over, and its result was shown
bool dropErased(const SessionFiles& files, Result& result, bool ran = true);
/// What `palpate devices --json` wrote.
DeviceCheck readDevices(const std::filesystem::path& figures);

/// What `palpate devices --force-test --json` wrote, into `check`.
void readForceTest(const std::filesystem::path& figures, DeviceCheck& check);

/// Takes the sessions that are done, and knows the earlier ones.
class ResultSink {
public:
    virtual ~ResultSink() = default;
    /// Where the files of a new session of this case go; nothing is there yet. Throws std::runtime_error where nothing can
    /// be written.
    virtual SessionFiles filesFor(const CaseEntry& of) = 0;
    /// A session that has ended with a score.
    virtual void keep(const CaseEntry& of, const SessionFiles& files, const Result& result) = 0;
    /// Points of the best session of a case.
    virtual std::optional<double> best(const CaseEntry& of) const = 0;
    /// Where pages and tables go.
    virtual std::filesystem::path folder() const = 0;
};

/// Keeps record (.db) and figures (.json) of each session in one folder, named by case and date.
class SessionFolder : public ResultSink {
public:
    explicit SessionFolder(std::filesystem::path folder);
    SessionFiles filesFor(const CaseEntry& of) override;
    /// Both files are there already.
    void keep(const CaseEntry&, const SessionFiles&, const Result&) override {}
    std::optional<double> best(const CaseEntry& of) const override;
    std::filesystem::path folder() const override { return folder_; }

private:
    std::filesystem::path folder_;
};

/// Why sessions cannot be kept in a folder, and what to do, in words; empty: they can.
std::string whyNoSessions(const std::filesystem::path& folder);
/// The same of profiles, which are in base::UserFolder::data.
std::string whyNoProfiles();
/// That the disk of this folder is nearly full, and what to do, in words; empty: it is not.
/// @param least  free bytes that are enough: a minute is 15 MB in the record and as much in its log
std::string littleRoom(const std::filesystem::path& folder, std::uintmax_t least = 100'000'000);
/// Where `palpate profile` keeps them.
std::filesystem::path profilesFile();

/// `sessions` of base::UserFolder::data; without a home, of a folder for temporary files.
std::filesystem::path sessionsFolder();

}  // namespace palpate::trainer
