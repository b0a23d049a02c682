#include <render/events.h>

#include <fmt/format.h>

#include <algorithm>

namespace palpate::render {

std::string text(const channel::Name& name)
{
    std::string words(name.data(), std::find(name.begin(), name.end(), '\0'));
    std::replace(words.begin(), words.end(), '_', ' ');
    return words;
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
    if (now.status != before.status && now.status != Status::running)
        add(now.status == Status::faulted ? EventKind::fault : EventKind::finished);
    return events;
}

std::string words(const Event& event, const channel::Scenery& scenery)
{
    const auto structure = text(scenery.structure[std::min<std::size_t>(event.structure, channel::maxStructures - 1)]);
    switch (event.kind) {
        case EventKind::contact:
            return "touches the skin";
        case EventKind::inserted:
            return "goes in";
        case EventKind::out:
            return "is out";
        case EventKind::near:
            return "near " + structure;
        case EventKind::veryNear:
            return "very near " + structure;
        case EventKind::touching:
            return "touching " + structure;
        case EventKind::fired:
            return fmt::format("core: {:.0f} % target", 100 * event.target);
        case EventKind::fault:
            return "FAULT: forces off";
        case EventKind::finished:
            break;
    }
    return "session ended";
}

}  // namespace palpate::render
