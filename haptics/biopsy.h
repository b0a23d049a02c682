#pragma once

#include <haptics/cuts.h>
#include <haptics/session_model.h>
#include <haptics/tick.h>
#include <occupancy/body.h>

namespace palpate::haptics {

/// The tissue that the gun takes when it is fired with the tip at `tip` and the needle along `axis`: the needle is thrown
/// forward by throwLength, and the notch is the last notchLength of it. The tissue in the notch is looked up in rest space,
/// where the labels are, less what earlier cores took: `coreSamples` points on rings around the notch's axis, each standing
/// for the same volume.
///
/// The core breaks along the notch's axis at a gap, and where soft meets stiff: where Young's modulus changes by
/// `breakingContrast` or more. Pieces under `minPiece` are debris. Both are assumed: of fragmentation it is only known
/// that it is common (17 % of the best 14 G cores, Berg et al. 1997) and that cores part at boundaries. Bounded work,
/// allocates nothing.
CoreSample takeCore(const SessionModel& model, const volume::Tissue::Reader& reader, const occupancy::Body& body,
                    const Cuts& cuts, Vec3 tip, Vec3 axis) noexcept;

/// The tissue of the core is gone from now on, and the needle's way from `tip` to the end of its throw is cut.
void removeCore(const SessionModel& model, const occupancy::Body& body, const CoreSample& core, Vec3 tip,
                Cuts& cuts) noexcept;

inline constexpr int coreSlices = 80;
inline constexpr int coreRings = 3;
inline constexpr int coreSectors = 8;
inline constexpr int coreSamples = coreSlices * coreRings * coreSectors;
inline constexpr double breakingContrast = 5.0;  // fat to high-grade carcinoma: 13; fat to skin: 17; fat to gland: 1
inline constexpr double minPiece = 1e-3;         // [m]

}  // namespace palpate::haptics
