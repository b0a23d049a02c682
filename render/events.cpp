#include <render/events.h>

#include <base/said.h>

#include <algorithm>

namespace palpate::render {

std::string text(const channel::Name& name)
{
    return {name.data(), std::find(name.begin(), name.end(), '\0')};
}

std::vector<Event> eventsBetween(const channel::State& before, const channel::State& now)
{
    using channel::Phase, channel::Warning, channel::Status;
    std::vector<Event> events;
    const auto add = [&](EventKind kind) { events.push_back({now.time, kind, now.warned, now.coreTarget}); };
    if (now.phase != before.phase)
        add(now.phase == Phase::free      ? EventKind::out
            : now.phase == Phase::contact ? EventKind::contact
                                          : EventKind::inserted);
    if (now.warning != Warning::none && (now.warning != before.warning || now.warned != before.warned))
        add(now.warning == Warning::near       ? EventKind::near
            : now.warning == Warning::veryNear ? EventKind::veryNear
                                               : EventKind::touching);
    if (now.cores > before.cores)
        add(EventKind::fired);
    if (now.stopped > before.stopped)
        events.push_back({now.time, EventKind::stopped, now.stoppedBy, now.thrown});
    if (now.refused > before.refused)
        events.push_back({now.time, EventKind::refused, now.refusedBy, 0});
    if (now.marks > before.marks)
        events.push_back({now.time, EventKind::marked, now.marks, 0});
    if (now.marks < before.marks)
        events.push_back({now.time, EventKind::unmarked, before.marks, 0});
    if (now.status != before.status && now.status != Status::running)
        add(now.status == Status::faulted ? EventKind::fault : EventKind::finished);
    return events;
}

using base::said;
using base::tr;

std::string tissueCalled(const channel::Scenery& scenery, std::uint32_t row)
{
    return base::spokenHere(text(scenery.tissue[std::min<std::size_t>(row, channel::maxTissues - 1)].name));
}

std::string words(const Event& event, const channel::Scenery& scenery)
{
    const auto structure =
        base::spokenHere(text(scenery.structure[std::min<std::size_t>(event.structure, channel::maxStructures - 1)]));
    switch (event.kind) {
        case EventKind::contact:
            return tr("touches the body");
        case EventKind::inserted:
            return tr("goes in");
        case EventKind::out:
            return tr("is out");
        case EventKind::near:
            return said(tr("near {}"), structure);
        case EventKind::veryNear:
            return said(tr("very near {}"), structure);
        case EventKind::touching:
            return said(tr("touching {}"), structure);
        case EventKind::fired:
            return said(tr("core: {:.0f} % target"), 100 * event.target);
        case EventKind::stopped:
            return said(tr("throw stopped by {} after {:.1Lf} mm"), tissueCalled(scenery, event.structure),
                        1e3 * event.target);
        case EventKind::refused:
            return event.structure == 0 ? tr("fired outside the body")
                                        : said(tr("fired against {}"), tissueCalled(scenery, event.structure));
        case EventKind::marked:
            return said(tr("mark {}"), event.structure);
        case EventKind::unmarked:
            return said(tr("mark {} taken back"), event.structure);
        case EventKind::fault:
            return tr("FAULT: forces off");
        case EventKind::finished:
            break;
    }
    return tr("session ended");
}

}  // namespace palpate::render
