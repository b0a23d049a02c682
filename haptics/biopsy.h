#pragma once

#include <haptics/session_model.h>
#include <haptics/tick.h>
#include <occupancy/body.h>

namespace palpate::haptics {

/// The tissue that the gun takes when it is fired with the tip at `tip` and the needle along `axis`: the needle is thrown
/// forward by throwLength, and the notch is the last notchLength of it. The tissue in the notch is looked up in rest space,
/// where the labels are: `coreSamples` points on rings around the notch's axis, each standing for the same volume.
/// Bounded work, allocates nothing.
CoreSample takeCore(const SessionModel& model, const volume::Tissue::Reader& reader, const occupancy::Body& body, Vec3 tip,
                    Vec3 axis) noexcept;

inline constexpr int coreSlices = 80;
inline constexpr int coreRings = 3;
inline constexpr int coreSectors = 8;

}  // namespace palpate::haptics
