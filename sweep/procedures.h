#pragma once

#include <haptics/recorder.h>
#include <haptics/servo.h>
#include <haptics/session_model.h>
#include <sweep/procedure.h>

#include <cstdint>
#include <vector>

namespace palpate::sweep {

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
