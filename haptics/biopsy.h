#pragma once

#include <haptics/cuts.h>
#include <haptics/session_model.h>
#include <haptics/tick.h>
#include <occupancy/body.h>

#include <cstdint>
#include <limits>

namespace palpate::haptics {

/// How far the gun throws the needle.
struct Throw {
    double length = 0;      // [m]
    std::uint8_t bone = 0;  // row of the bone that ends it there; 0: none does

    /// The needle is in bone or at it, and the gun is not to be fired: bone leaves less than a piece of a core.
    bool isBlocked() const noexcept;
};

/// By throwLength, but no farther than to the first tissue of role bone on the needle's axis, in the deformed body.
/// @param proxy  of the tip, at rest: a tip that bone holds back is pressed into it and may lie behind it [m]
Throw throwOf(const SessionModel& model, const volume::Tissue::Reader& reader, const occupancy::Body& body, Vec3 proxy,
              Vec3 tip, Vec3 axis) noexcept;

/// The tissue that the gun takes when it is fired with the tip at `tip` and the needle along `axis`: the needle is thrown
/// forward by `thrown`, at most throwLength, and the notch is the last notchLength of it; of a throw that is shorter, all
/// of it. The tissue in the notch is looked up in rest space, where the labels are, less what earlier cores took:
/// `coreSamples` points on rings around the notch's axis, each standing for the same volume.
///
/// The core breaks along the notch's axis at a gap, and where soft meets stiff: where Young's modulus changes by
/// `breakingContrast` or more. Pieces under `minPiece` are debris. Both are assumed: of fragmentation it is only known
/// that it is common (17 % of the best 14 G cores, Berg et al. 1997) and that cores part at boundaries. Bounded work,
/// allocates nothing.
CoreSample takeCore(const SessionModel& model, const volume::Tissue::Reader& reader, const occupancy::Body& body,
                    const Cuts& cuts, Vec3 tip, Vec3 axis,
                    double thrown = std::numeric_limits<double>::infinity()) noexcept;

/// The tissue of the core is gone from now on, and the needle's way from `tip` to the end of its throw is cut.
void removeCore(const SessionModel& model, const occupancy::Body& body, const CoreSample& core, Vec3 tip,
                Cuts& cuts) noexcept;

inline constexpr int coreSlices = 80;
inline constexpr int coreRings = 3;
inline constexpr int coreSectors = 8;
inline constexpr int coreSamples = coreSlices * coreRings * coreSectors;
inline constexpr double breakingContrast = 5.0;  // fat to high-grade carcinoma: 13; fat to skin: 17; fat to gland: 1
inline constexpr double minPiece = 1e-3;         // [m]
inline constexpr double throwStep = 0.25e-3;     // [m]

inline bool Throw::isBlocked() const noexcept
{
    return bone != 0 && length < minPiece;
}

}  // namespace palpate::haptics
