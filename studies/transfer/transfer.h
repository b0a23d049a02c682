#pragma once

#include <haptics/session_model.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace palpate::studies {

/// How positions went from the ticks of a session to a viewer's process.
struct Transfer {
    std::vector<double> seconds;  // from the tick's publishing to the viewer having it, in the order in which they came
    std::uint64_t sent = 0;       // ticks
};

enum class Transport : std::uint8_t { sharedMemory, namedPipe };

struct TransferOptions {
    Transport transport = Transport::sharedMemory;
    double seconds = 3.0;  // of the session
    double setUp = 0.0;    // the viewer is attached, and then busy with something else for so long [s]
};

/// Runs a session, paced, and beside it a process that receives each tick's position. Both ask for real-time priority.
///
/// Shared memory: the process sleeps until 150 us before a tick is due and then spins on the state, as a viewer that wants
/// the newest position with the least delay would.
/// Named pipe: the process is blocked in read(); the position is written after every tick, as the thesis's two processes
/// did (experiment 1).
///
/// Throws std::runtime_error where the process or the pipe cannot be made.
Transfer measureTransfer(const haptics::SessionModel& model, const TransferOptions& options);

/// A picture of a viewer, by the clock CLOCK_MONOTONIC; see render::Shown.
struct TimelinePicture {
    std::uint64_t tick = 0;
    double published = 0, read = 0, done = 0;  // [s]
};

/// What `palpate-view --timeline FILE` wrote. Throws std::runtime_error for fewer than two pictures.
std::vector<TimelinePicture> readTimeline(const std::filesystem::path& file);

}  // namespace palpate::studies
