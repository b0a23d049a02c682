#include <render/coach.h>

#include <base/direction.h>
#include <base/said.h>
#include <render/deformation.h>
#include <render/events.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::render {
namespace {

using base::said;
using base::tr;

constexpr double atRim = 3e-3;       // from the target's surface: near enough to fire [m]
constexpr double offLine = 3e-3;     // of tip from planned line that is told [m]
constexpr double restFor = 3.0;      // on the skin, where no more is asked for [s]
constexpr double restForce = 2.0;    // force of such a rest [N]
constexpr double offMiddle = 1e-3;   // of the needle's line from the target's middle that is told [m]
constexpr double refusalSaid = 2.0;  // that the gun did not fire [s]
constexpr double stopSaid = 4.0;     // that bone stopped its throw [s]

const char* directionInWords(glm::dvec3 way)
{
    return tr(base::directionInWords(way.x, way.y, way.z));
}

double millimetres(double metres)
{
    return metres * 1e3;
}

std::string target(const channel::Scenery& scenery)
{
    const std::string name = text(scenery.structure[0]);
    return name.empty() ? tr("target") : base::spokenHere(name);
}

// From the planned line to the tip, across the line [m].
glm::dvec3 offPlan(const channel::Scenery& scenery, const channel::State& state)
{
    const glm::dvec3 entry = vec(scenery.entry), line = glm::normalize(vec(scenery.aim) - entry);
    const glm::dvec3 off = vec(state.tip) - entry;
    return off - glm::dot(off, line) * line;
}

std::string lineFault(const channel::Scenery& scenery, const channel::State& state)
{
    const glm::dvec3 off = offPlan(scenery, state);
    return glm::length(off) > offLine ? said(tr("The tip is {:.0f} mm off the line, towards {}"),
                                             millimetres(glm::length(off)), directionInWords(off))
                                      : "";
}

// Where the needle goes from here: past the target, or beyond it.
std::string wayFault(const channel::Scenery& scenery, const channel::State& state, glm::dvec3 aim)
{
    if (state.distance[0] <= 0)
        return -state.distance[0] > atRim ? said(tr("The tip is {:.0f} mm inside the {}: draw back to its near rim"),
                                                 millimetres(-state.distance[0]), target(scenery))
                                          : "";
    if (std::isfinite(state.ahead[0]))
        return "";
    const glm::dvec3 way = aim - vec(state.tip), axis = vec(state.axis);
    const double along = glm::dot(way, axis);
    if (along < 0)
        return said(tr("The tip is beyond the {}: draw back"), target(scenery));
    const glm::dvec3 across = way - along * axis;
    // Beyond what is looked at along the line, and where cores have taken what the line meets, the target counts as a ball.
    const bool unseen = glm::length(way) > channel::lookAheadReach || state.cores > 0;
    const double radius = unseen ? glm::length(way) - state.distance[0] : 0.0;
    if (glm::length(across) < std::max(offMiddle, radius))
        return "";
    return said(tr("The needle passes the {}: its middle lies {:.0f} mm towards {}"), target(scenery),
                millimetres(glm::length(across)), directionInWords(across));
}

// What else the gun would hit.
std::string throwFault(const channel::Scenery& scenery, const channel::State& state)
{
    for (std::size_t s = 1; s < std::min<std::size_t>(scenery.structures, channel::maxStructures); ++s)
        if (state.ahead[s] >= 0 && state.ahead[s] < scenery.throwLength)
            return said(tr("Do not fire: the {:.0f} mm of the throw would reach {}"), millimetres(scenery.throwLength),
                        base::spokenHere(text(scenery.structure[s])));
    return "";
}

// Of a needle that is not inside yet: to the skin, and on it.
void coachToSkin(const channel::Scenery& scenery, const channel::State& state, const CoachView& view, Coaching& c)
{
    const bool told = view.planned && scenery.entry != scenery.aim;
    c.wrong = told ? lineFault(scenery, state) : "";
    if (state.phase == channel::Phase::contact) {
        c.step = 2;
        c.now = tr("Push along the needle until the skin gives way");
        return;
    }
    c.step = 1;
    c.now = told ? tr("Touch the skin at the mark, where the planned line begins") : tr("Touch the skin with the needle");
}

std::string toGo(const channel::State& state, const CoachView& view)
{
    // The way on the needle's line is no shorter than the distance that stands beside.
    const double left = std::isfinite(state.ahead[0]) ? std::max(state.ahead[0], state.distance[0]) : state.distance[0];
    return view.planned ? said(tr(" ({:.0f} mm to go)"), millimetres(left)) : "";
}

Coaching approach(const channel::Scenery& scenery, const channel::State& state, const CoachView& view)
{
    Coaching c{0, 5, "", "", false};
    if (state.phase != channel::Phase::inserted) {
        coachToSkin(scenery, state, view, c);
    } else if (state.distance[0] > atRim) {
        c.step = 3;
        c.now = said(tr("Advance until the tip is at the {}'s rim{}"), target(scenery), toGo(state, view));
        c.wrong = view.planned ? wayFault(scenery, state, view.aim) : "";
    } else {
        c.step = 4;
        c.now = !view.handIsHere ? tr("Fire the gun")
                : view.scanned   ? tr("Fire the gun (Space)")
                                 : tr("Fire the gun (Space, or the other mouse button)");
        const std::string danger = throwFault(scenery, state);
        c.wrong = !danger.empty() ? danger : view.planned ? wayFault(scenery, state, view.aim) : "";
    }
    if (state.cores > 0 && c.wrong.empty())
        c.wrong = said(tr("Core {} holds {:.0f} % {}: take another"), state.cores, 100 * state.coreTarget, target(scenery));
    return c;
}

Coaching biopsy(const channel::Scenery& scenery, const channel::State& state, const CoachView& view)
{
    if (state.cores == 0 || !isEnough(state.bestTarget))
        return approach(scenery, state, view);
    if (state.phase != channel::Phase::free)
        return {5, 5,
                said(tr("Core {} holds {:.0f} % {}: draw the needle out"), state.bestCore, 100 * state.bestTarget,
                     target(scenery)),
                "", false};
    return {5, 5,
            view.handIsHere ? tr("Done: end the session (E, or click here), or take another core")
                            : tr("Done: the core is out"),
            "", view.handIsHere};
}

// No core: the tip into the target, and back.
Coaching advance(const channel::Scenery& scenery, const channel::State& state, const CoachView& view)
{
    Coaching c{0, 4, "", "", false};
    const bool inside = state.phase == channel::Phase::inserted;
    if (state.reached != 0) {
        c.step = 4;
        c.now = inside            ? said(tr("The tip is in the {}: stop there, and draw the needle back"), target(scenery))
                : view.handIsHere ? tr("Done: end the session (E, or click here)")
                                  : tr("Done: the needle is out");
        c.last = !inside && view.handIsHere;
    } else if (!inside) {
        coachToSkin(scenery, state, view, c);
    } else {
        c.step = 3;
        c.now = said(tr("Advance until the tip is in the {}{}"), target(scenery), toGo(state, view));
        c.wrong = view.planned ? wayFault(scenery, state, view.aim) : "";
    }
    return c;
}

// The skin is touched and not pierced.
Coaching touch(const channel::Scenery& scenery, const channel::State& state, const CoachView& view)
{
    Coaching c{0, 3, "", "", false};
    const double left = restFor - 1e-3 * state.rested;
    if (state.phase == channel::Phase::inserted) {
        c.step = 2;
        c.now = tr("Draw the needle back until it is off the skin");
        c.wrong = tr("The skin is pierced: it was only to be touched");
    } else if (state.phase == channel::Phase::contact) {
        c.step = left > 0 ? 2 : 3;
        c.now = left > 0 ? said(tr("Rest here, {:.0f} s more: the skin gives way a little, and is not to be pierced"),
                                std::ceil(left))
                         : tr("Lift off");
        c.wrong = glm::length(vec(state.total)) > restForce
                      ? said(tr("You push with {:.1Lf} N: let the tool rest"), glm::length(vec(state.total)))
                      : "";
    } else if (left > 0) {
        coachToSkin(scenery, state, view, c);
    } else {
        c.step = 3;
        c.now =
            view.handIsHere ? tr("Done: end the session (E, or click here)") : tr("Done: the tool has rested on the skin");
        c.last = view.handIsHere;
    }
    return c;
}

Coaching palpation(const channel::State& state, const CoachView& view)
{
    if (state.marks >= 2)
        return {3, 3,
                view.handIsHere ? tr("End the session (E, or click here), or mark another edge (M)")
                                : tr("Done: both edges are marked"),
                "", view.handIsHere};
    if (state.phase == channel::Phase::free)
        return {1, 3, tr("Touch the skin with the fingertip"), "", false};
    std::string now = state.marks == 0 ? tr("Press here and there: where is it harder? Mark one edge of it")
                                       : tr("Mark the opposite edge of the lump");
    return {2, 3, now + (view.handIsHere ? " (M)" : ""), "", false};
}

// Where the tool has gone to, and which keys bring it back.
std::string lostTool(const channel::State& state, const CoachView& view)
{
    const glm::dvec3 way = view.aim - vec(state.tip), axis = vec(state.axis);
    const double along = glm::dot(way, axis);
    if (std::abs(along) < glm::length(way - along * axis))
        return tr("The tool is outside the picture: the arrow keys bring it back");
    return along > 0 ? tr("The tool is outside the picture: the wheel forward, or Page down, brings it back")
                     : tr("The tool is outside the picture: the wheel back, or Page up, brings it back");
}

// What the gun has just done that a figure of the picture does not say, or not for long enough.
std::string gunFault(const channel::Scenery& scenery, const channel::State& state)
{
    const auto within = [&](double moment, double seconds) { return moment >= 0 && state.time - moment < seconds; };
    const bool inside = state.phase == channel::Phase::inserted;
    if (within(state.refused, refusalSaid) && state.refusedBy != 0)
        return said(tr("The gun does not fire against {}: draw back and turn"), tissueCalled(scenery, state.refusedBy));
    if (within(state.refused, refusalSaid) && !inside)
        return tr("The gun fires only inside the body");
    if (within(state.stopped, stopSaid) && inside)
        return said(tr("The throw was stopped by {} after {:.1Lf} mm"), tissueCalled(scenery, state.stoppedBy),
                    millimetres(state.thrown));
    return "";
}

Coaching coachTask(const channel::Scenery& scenery, const channel::State& state, const CoachView& view)
{
    if (scenery.task == channel::Task::touch)
        return touch(scenery, state, view);
    if (scenery.task == channel::Task::advance)
        return advance(scenery, state, view);
    const bool needle = scenery.tool == channel::ToolKind::needle;
    return needle && !view.targetHidden ? biopsy(scenery, state, view) : palpation(state, view);
}

}  // namespace

bool isEnough(double target) noexcept
{
    constexpr double half = 50;  // [%]
    return std::round(100 * target) >= half;
}

Coaching coach(const channel::Scenery& scenery, const channel::State& state, const CoachView& view)
{
    if (state.status == channel::Status::finished)
        return {};
    if (state.status == channel::Status::faulted)
        return {1, 1, tr("End the session"), tr("The forces are off"), view.handIsHere};
    Coaching c = coachTask(scenery, state, view);
    const std::string gun = gunFault(scenery, state);
    c.wrong = gun.empty() ? c.wrong : gun;
    if (view.outOfSight && view.handIsHere && state.phase == channel::Phase::free && !c.last)
        c.wrong = lostTool(state, view);
    return c;
}

}  // namespace palpate::render
