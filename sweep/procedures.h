#pragma once

#include <haptics/session_model.h>
#include <haptics/tick.h>
#include <sweep/procedure.h>

#include <cstdint>
#include <functional>
#include <vector>

namespace palpate::sweep {

/// What a procedure measured.
struct ProcedureResult {
    std::vector<double> values;  // by outputsOf(); not finite: none
    double tickTime = 0;         // mean processor time of this thread in a tick in contact [s]
};

/// Carries a procedure out in simulated time; `seen` gets every tick. The same model, procedure and seed give the same
/// values, bit for bit, on any machine. Throws std::runtime_error where the procedure does not go with the scene.
ProcedureResult carryOut(const haptics::SessionModel& model, const Procedure& procedure, std::uint64_t seed,
                         const std::function<void(const haptics::TickRecord&)>& seen);

}  // namespace palpate::sweep
