#pragma once

#include <chainmail/window_stack.h>
#include <haptics/session_model.h>

#include <functional>
#include <span>
#include <string>
#include <vector>

namespace palpate::planner {

/// What a tick of level `elastic` has to do: means over the ticks in contact.
struct TickWork {
    double slots = 0;     // nodes of all windows, rows filled up to whole vectors
    double cycles = 0;    // of relaxation
    double contacts = 0;  // points that a tool may press
};

/// What that takes under one law [ns]: slots (perSlot + cycles perSlotCycle) + contacts (perContact + cycles
/// perContactCycle).
struct LawCosts {
    double perSlot = 0;
    double perSlotCycle = 0;
    double perContact = 0;
    double perContactCycle = 0;
};

/// Time of the work [us].
double tickTime(const LawCosts& costs, const TickWork& work) noexcept;

/// One measured model.
struct TickSample {
    std::string name;
    TickWork work;
    bool finite = false;      // strain
    double microseconds = 0;  // mean
};

/// The costs, none negative, with the least sum of squared relative errors of the predicted times. Throws
/// std::runtime_error for fewer than four samples.
LawCosts fitCosts(std::span<const TickSample> samples);

/// Times ticks of the models that the planner chooses from, for the scene's own push with spheres of 5 and 10 mm radius.
/// `quick`: few of them. Cost: a minute or two, quick some seconds.
std::vector<TickSample> measureTicks(const haptics::SessionModel& model, bool quick,
                                     const std::function<void(const std::string& what)>& progress);

/// Nodes of the windows, rows filled up to whole vectors.
std::size_t slotsOf(const chainmail::WindowStack& stack) noexcept;

}  // namespace palpate::planner
