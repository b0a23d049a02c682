#pragma once

#include <haptics/recorder.h>
#include <haptics/servo.h>
#include <haptics/session_model.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::sweep {

/// What is done in a case. `session`: what `palpate train` does, with a simulated hand. `press`, `needle`: the tool goes
/// along a prescribed way and what it feels is measured.
enum class ProcedureKind : std::uint8_t { session, press, needle };
inline constexpr std::array<std::string_view, 3> procedureNames{"session", "press", "needle"};

struct Procedure {
    ProcedureKind kind = ProcedureKind::session;
    // session
    std::string trainee;                // whose hand, see haptics/trainee.h; empty: one that follows the scene's script
    std::optional<std::uint64_t> seed;  // of the trainee's errors; nothing: the case's own
    double delay = 0;                   // from computing a force to the hand, of which the stabiliser knows nothing [s]
    double seconds = 120;               // of the session, at most
    // press, needle
    double depth = 5e-3;   // of the tool's foremost point below the surface at rest [m]
    double speed = 20e-3;  // [m/s]
    double hold = 0.1;     // at the depth [s]
    double aside = 0;      // press: from the scene's entry along the surface, to the patient's left [m]
};

/// One number that a procedure gives.
struct OutputInfo {
    std::string name;  // ends in its unit
    std::string meaning;
};
/// In the order of its results.
std::vector<OutputInfo> outputsOf(ProcedureKind kind);

/// What a procedure measured.
struct ProcedureResult {
    std::vector<double> values;  // by outputsOf(); not finite: none
    double tickTime = 0;         // mean processor time of this thread in a tick in contact [s]
};

/// Carries a procedure out in simulated time. The same model, procedure and seed give the same values, bit for bit, on any
/// machine.
/// @param info      of the model, see haptics::infoOf()
/// @param recorder  gets every tick; null: none
/// @param also      gets every tick after it; may throw to end the procedure
/// Throws std::runtime_error where the procedure does not go with the scene.
ProcedureResult carryOut(const haptics::SessionModel& model, const haptics::SessionInfo& info, const Procedure& procedure,
                         std::uint64_t seed, haptics::Recorder* recorder, const haptics::TickSink& also = {});

}  // namespace palpate::sweep
