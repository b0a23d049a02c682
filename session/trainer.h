#pragma once

#include <session/devices.h>
#include <session/faults.h>
#include <session/session.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace palpate::session {

/// What is asked of a session.
struct TrainOptions {
    DeviceRequest device;          // hand, mouse, falcon or a record
    std::string session;           // name for viewers
    std::filesystem::path record;  // empty: none
    haptics::ServoOptions servo;   // pace and length
    Faults faults;                 // on purpose
    /// Stops them (true) or lets them go on; called from a thread of its own. Fault `stallViewer` needs it.
    std::function<void(bool)> stallViewers;
    /// Called ten times a second while the session runs, from the thread of run(); false ends this session.
    std::function<bool()> lookAfter;
};

/// What a session came to, with everything around it.
struct TrainResult : SessionFigures {
    haptics::ServoTiming timing;        // of the loop
    std::uint64_t lostRecords = 0;      // ticks that the recorder had no room for
    bool recordCut = false;             // a record was asked for, and it has not all ticks
    std::vector<std::string> warnings;  // a sentence each, for the user
    bool restart = false;               // its user wants it to begin anew
    int signal = 0;                     // that ended it before its time; 0: none
    std::string problem;                // not empty: the session ran, but not everything that was asked for was done
};

/// A session with everything around it: device, servo thread, viewers' channel, recorder, score. Several may run at once,
/// each in a thread of its own, with sessions and records of different names.
class Trainer {
public:
    /// Opens device, channel and record. Throws std::runtime_error, also for a rate other than 1000 Hz, which hands and
    /// faults keep, and for fault `stallViewer` without `stallViewers`. The model must outlive it.
    Trainer(const haptics::SessionModel& model, const haptics::SessionInfo& info, const TrainOptions& options);
    ~Trainer();

    /// Runs the session to its end, or to SIGINT (Ctrl-C), SIGTERM, SIGHUP or SIGQUIT, which end it, and all others that
    /// run, in order: force to zero, record complete. Once: throws std::runtime_error when it is called again.
    TrainResult run();

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::session
