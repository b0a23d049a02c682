#include <channel/bounds.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace palpate::channel {
namespace {

constexpr double furthest = 100;                // of a place [m]
constexpr double furthestMoved = 1;             // of a node, from where it is at rest [m]
constexpr std::uint64_t mostNodes = 1U << 24U;  // of a lattice; viewers keep some 64 bytes of each
constexpr double strongest = 1e4;               // force [N]
constexpr double largestValue = 1e12;
constexpr std::array<std::int32_t, 3> noNodes{};  // of a body that does not deform, or without fine labels
constexpr std::uint32_t maxSlices = 99;           // of a CT scan
constexpr std::uint32_t maxPattern = 3;           // of TissueSound

bool upTo(double value, double most) noexcept
{
    return std::abs(value) <= most;  // false for what is not a number
}

template <typename Number, std::size_t n>
bool upTo(const std::array<Number, n>& values, double most) noexcept
{
    return std::ranges::all_of(values, [most](Number x) { return upTo(static_cast<double>(x), most); });
}

bool within(double value, double least, double most) noexcept
{
    return value >= least && value <= most;  // false for what is not a number
}

bool within(float value, double least, double most) noexcept
{
    return within(static_cast<double>(value), least, most);
}

bool ended(const Name& name) noexcept
{
    return std::find(name.begin(), name.end(), '\0') != name.end();
}

bool sound(const Grid& grid) noexcept
{
    return voxelsOf(grid) > 0 && grid.spacing > 1e-6 && grid.spacing < 1 && upTo(grid.origin, furthest);
}

bool sound(const TissueLook& look) noexcept
{
    const auto fraction = [](float v) { return within(v, 0, 1); };
    return ended(look.name) && fraction(look.opacity) && std::ranges::all_of(look.colour, fraction);
}

// Nothing of a tissue without figures is shown, and what reads a table takes these bounds too.
bool sound(const TissueSound& s) noexcept
{
    return within(s.soundSpeed, 0, 1e4) && within(s.density, 0, 1e5) && within(s.attenuation, 0, 1e3) &&
           within(s.attenuationPower, 0, 3) && within(s.echo, -100, 60) && within(s.echoVariation, 0, 30) &&
           s.pattern <= maxPattern;
}

// The fine labels are of no size where there are none.
bool soundOfUltrasound(const Scenery& s) noexcept
{
    return (s.fine.size == noNodes || sound(s.fine)) && s.probe <= ProbeKind::curved && within(s.probeDepth, 0, 1) &&
           within(s.probeFrequency, 0, 1e8) && within(s.probeFocus, 0, 1) && within(s.holeRadius, 0, 1) &&
           std::ranges::all_of(s.sound, [](const TissueSound& t) { return sound(t); });
}

// Its axes are unit vectors at right angles.
bool sound(const ProbePose& p) noexcept
{
    const auto product = [](const Triple& a, const Triple& b) {
        return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
    };
    constexpr double loose = 1e-3;
    return upTo(p.face, furthest) && upTo(product(p.axial, p.axial) - 1, loose) &&
           upTo(product(p.lateral, p.lateral) - 1, loose) && upTo(product(p.axial, p.lateral), loose) &&
           upTo(p.force, strongest);
}

bool sound(const Hole& h) noexcept
{
    return upTo(h.from, furthest) && upTo(h.to, furthest);
}

bool sound(const Mark& m) noexcept
{
    return upTo(m.place, furthest) && upTo(m.axis, furthest);
}

}  // namespace

std::uint64_t voxelsOf(const Grid& grid) noexcept
{
    std::uint64_t count = 1;
    for (const std::int32_t n : grid.size)
        count *= n > 0 && n <= longestSide ? static_cast<std::uint64_t>(n) : 0;
    return count;
}

bool sound(const Scenery& s) noexcept
{
    if (!ended(s.scene) || !sound(s.labels) ||
        !(s.lattice.size == noNodes || (sound(s.lattice) && voxelsOf(s.lattice) <= mostNodes)) || s.tissues > maxTissues ||
        s.structures > maxStructures || s.windows > maxWindows || s.tool > ToolKind::capsule || s.task > Task::advance ||
        !ended(s.imageUnit) || !ended(s.who))
        return false;
    for (std::size_t i = 0; i < s.tissues; ++i)
        if (!sound(s.tissue[i]))
            return false;
    for (std::size_t i = 0; i < s.structures; ++i)
        if (!ended(s.structure[i]) || !(s.warnDistance[i] >= 0 && s.warnDistance[i] <= furthest))
            return false;
    for (std::size_t i = 0; i < s.windows; ++i)
        if (!ended(s.window[i].name) || !upTo(s.window[i].low, largestValue) || !upTo(s.window[i].high, largestValue))
            return false;
    return s.toolRadius >= 0 && s.toolRadius <= 1 && s.toolLength >= 0 && s.toolLength <= 10 && upTo(s.entry, furthest) &&
           upTo(s.aim, furthest) && upTo(s.forceCap, strongest) && upTo(s.imageLow, largestValue) &&
           upTo(s.imageStep, largestValue) && soundOfUltrasound(s) && s.ctSlices <= maxSlices && within(s.ctWidth, 0, 1) &&
           within(s.ctDoseIndex, 0, 1e4) && within(s.ctDoseLength, 0, 1e6);
}

bool sound(const State& s, const Scenery& scenery) noexcept
{
    const auto number = [](double v) { return !std::isnan(v); };  // a distance may be infinite
    const bool places = upTo(s.tip, furthest) && upTo(s.axis, furthest) && upTo(s.bend, furthest) &&
                        upTo(s.proxy, furthest) && upTo(s.inserted, furthest) && upTo(s.aheadSpeed, strongest);
    const bool forces = upTo(s.basic, strongest) && upTo(s.additional, strongest) && upTo(s.total, strongest);
    const std::uint32_t tissues = std::max<std::uint32_t>(scenery.tissues, 1);
    const bool rows = s.phase <= Phase::inserted && s.status <= Status::faulted && s.warning <= Warning::touching &&
                      s.tissue < tissues && s.aheadTissue < tissues && s.refusedBy < tissues && s.stoppedBy < tissues &&
                      s.warned < std::max<std::uint32_t>(scenery.structures, 1);
    const bool probe =
        sound(s.probe) && s.holes <= maxHoles && std::ranges::all_of(s.hole, [](const Hole& h) { return sound(h); });
    const bool marks = std::ranges::all_of(s.mark, [](const Mark& m) { return sound(m); });
    return places && forces && rows && probe && marks && upTo(s.time, largestValue) && upTo(s.tickP99, largestValue) &&
           upTo(s.coreTarget, furthest) && upTo(s.coreLength, furthest) && upTo(s.bestTarget, furthest) &&
           upTo(s.refused, largestValue) && upTo(s.stopped, largestValue) && upTo(s.thrown, furthest) &&
           number(s.aheadTissueDistance) && std::ranges::all_of(s.distance, number) && std::ranges::all_of(s.ahead, number);
}

bool sound(const Input& input) noexcept
{
    return upTo(input.target, furthest) && upTo(input.axis, furthest) && upTo(input.probe, furthest);
}

bool sound(const Displacement& d, std::uint64_t nodes) noexcept
{
    return d.node < nodes && upTo(d.u, furthestMoved);
}

}  // namespace palpate::channel
