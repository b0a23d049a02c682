#pragma once

#include <haptics/recorder.h>
#include <haptics/session_model.h>
#include <haptics/simulation.h>
#include <volume/resample.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace palpate::session {

/// The body of a recorded session at one moment, computed again from the record's poses.
class DeformedState {
public:
    /// @param file      the record
    /// @param at        session time [s]; the last tick that is not later
    /// @param progress  is called with the share that is done; may be empty
    /// Throws std::runtime_error for a time that the record does not have and for forces that are not the record's.
    DeformedState(const std::string& file, double at, const std::function<void(double)>& progress);

    DeformedState(const DeformedState&) = delete;
    DeformedState& operator=(const DeformedState&) = delete;

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
