#pragma once

#include <trainer/grip.h>
#include <trainer/results.h>
#include <trainer/state.h>

#include <filesystem>
#include <memory>
#include <vector>

namespace palpate::trainer {

/// Does what the window's buttons ask for, each by a command in a process of its own.
class Errands {
public:
    /// @param programs  folder of palpate and palpate-view
    /// @param sink      must outlive this
    Errands(std::filesystem::path programs, ResultSink& sink);
    /// Ends what runs, in order.
    ~Errands();

    /// The cases, the profiles and the curricula that there are.
    void list(State& state);
    /// Never throws for what the user can mend: that stands in the state's notice.
    void run(Errand errand, State& state);
    /// Looks what has ended and what there is anew, and tells the state. To be called often. Returns whether something
    /// changed. Never throws for what went wrong outside: that stands in the state's notice.
    bool look(State& state);
    /// What was pressed at a device's grip since this was last called.
    std::vector<Press> pressed();

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::trainer
