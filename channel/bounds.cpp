#include <channel/bounds.h>

#include <algorithm>
#include <cmath>

namespace palpate::channel {
namespace {

constexpr std::int32_t longestSide = 4096;
constexpr double furthest = 100;   // of a place [m]
constexpr double strongest = 1e4;  // force [N]
constexpr double largestValue = 1e12;
constexpr std::array<std::int32_t, 3> noNodes{};  // of a body that does not deform

bool upTo(double value, double most) noexcept
{
    return std::abs(value) <= most;  // false for what is not a number
}

bool upTo(const Triple& v, double most) noexcept
{
    return std::all_of(v.begin(), v.end(), [most](double x) { return upTo(x, most); });
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
    const auto share = [](float v) { return v >= 0.0F && v <= 1.0F; };
    return ended(look.name) && share(look.opacity) && std::all_of(look.colour.begin(), look.colour.end(), share);
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
    if (!ended(s.scene) || !sound(s.labels) || !(s.lattice.size == noNodes || sound(s.lattice)) || s.tissues > maxTissues ||
        s.structures > maxStructures || s.windows > maxWindows || s.tool > ToolKind::capsule || !ended(s.imageUnit))
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
           upTo(s.imageStep, largestValue);
}

bool sound(const State& s, const Scenery& scenery) noexcept
{
    const auto number = [](double v) { return !std::isnan(v); };  // a distance may be infinite
    const bool places = upTo(s.tip, furthest) && upTo(s.axis, furthest) && upTo(s.bend, furthest) &&
                        upTo(s.proxy, furthest) && upTo(s.inserted, furthest) && upTo(s.aheadSpeed, strongest);
    const bool forces = upTo(s.basic, strongest) && upTo(s.additional, strongest) && upTo(s.total, strongest);
    const bool rows = s.phase <= Phase::inserted && s.status <= Status::faulted && s.warning <= Warning::touching &&
                      s.tissue < maxTissues && s.aheadTissue < maxTissues &&
                      s.warned < std::max<std::uint32_t>(scenery.structures, 1);
    return places && forces && rows && upTo(s.time, largestValue) && upTo(s.tickP99, largestValue) &&
           upTo(s.coreTarget, furthest) && upTo(s.coreLength, furthest) && number(s.aheadTissueDistance) &&
           std::all_of(s.distance.begin(), s.distance.end(), number) && std::all_of(s.ahead.begin(), s.ahead.end(), number);
}

bool sound(const Input& input) noexcept
{
    return upTo(input.target, furthest) && upTo(input.axis, furthest);
}

bool sound(const Displacement& d, std::uint64_t nodes) noexcept
{
    return d.node < nodes &&
           std::all_of(d.u.begin(), d.u.end(), [](float u) { return upTo(static_cast<double>(u), furthest); });
}

}  // namespace palpate::channel
