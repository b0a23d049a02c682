#pragma once

// What values a record may hold; shared by the writer (recorder.cpp) and the reader (record.cpp), no public header.

#include <haptics/recorder.h>
#include <haptics/tick.h>

namespace palpate::haptics::format {

inline constexpr double slowestRate = 100, fastestRate = 20000;  // of a loop [Hz]
inline constexpr double strongestForce = 1e3;                    // that is sent [N]
inline constexpr std::size_t longestName = 200;                  // [bytes]
inline constexpr std::uint64_t lastTick = std::uint64_t{1} << 40U;

/// Throws std::runtime_error ("what is wrong").
void checkInfo(const SessionInfo& info);

/// Throws std::runtime_error ("tick 7: what is wrong"): for a pose that is none, a force that was not sent, a row of a
/// tissue or structure that the session does not have, a core that is none.
void checkTick(const TickRecord& tick, const SessionInfo& info);

}  // namespace palpate::haptics::format
