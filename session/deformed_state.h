#pragma once

#include <haptics/recorder.h>
#include <haptics/scenery.h>
#include <haptics/session_model.h>
#include <haptics/simulation.h>
#include <volume/resample.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace palpate::session {

/// The last tick of a record that is not later than `at` [s]. Throws std::runtime_error for a time that it does not have.
std::uint64_t tickAt(const haptics::Record& record, const std::string& file, double at);

/// Computes a record again up to `tick`, and tells `each` of every tick; both may be empty. Throws std::runtime_error for
/// forces that are not the record's.
void recompute(const haptics::Record& record, haptics::Simulation& simulation, const std::string& file, std::uint64_t tick,
               const std::function<void(const haptics::TickRecord&)>& each, const std::function<void(double)>& progress);

/// What a viewer was shown at one moment of a record.
struct ShownState {
    haptics::Showing showing;                                                            // what it was told once
    channel::State state;                                                                // of the tick
    std::unique_ptr<channel::Displaced> shape = std::make_unique<channel::Displaced>();  // the last that was published
};

/// Computes a record again up to `at` [s]. `shapeTick`: when the displaced nodes were published; nothing: the last
/// publication before `at`. Throws as DeformedState.
ShownState shownState(const haptics::Record& record, double at, std::optional<std::uint64_t> shapeTick,
                      const std::function<void(double)>& progress);

/// The body of a recorded session at one moment, computed again from the record's poses.
class DeformedState {
public:
    /// @param record    stays open for as long as this
    /// @param at        session time [s]; the last tick that is not later
    /// @param progress  is called with the share that is done; may be empty
    /// Throws std::runtime_error for a time that the record does not have and for forces that are not the record's.
    DeformedState(haptics::Record record, double at, const std::function<void(double)>& progress);
    /// The same of the record in a file.
    DeformedState(const std::string& file, double at, const std::function<void(double)>& progress)
        : DeformedState(haptics::Record(file), at, progress)
    {
    }

    DeformedState& operator=(DeformedState&&) = delete;

    std::uint64_t tick() const noexcept { return tick_; }                   // of the record
    const haptics::SessionModel& model() const noexcept { return model_; }  // of the record
    /// The displaced nodes at that moment.
    const chainmail::DisplacedLattice& shape() const noexcept { return simulation_->shape(); }

    /// The labels as the tissue lies now, on the voxels of the volume: each has the label of the material that is at its
    /// middle, and 0 where there is none.
    volume::LabelImage labels() const;
    /// Displacement of the material at rest at the nodes of the lattice [mm].
    std::vector<Vec3f> displacement() const;
    /// The way from each place of the lattice's grid to where its material was at rest [mm]: what programs take that warp
    /// an image to the deformed state.
    std::vector<Vec3f> inverse() const;
    /// The nodes of the lattice.
    volume::VoxelGrid grid() const;

private:
    haptics::Record record_;
    haptics::SessionModel model_;
    std::unique_ptr<haptics::Simulation> simulation_;
    std::uint64_t tick_ = 0;
};

}  // namespace palpate::session
