#include <haptics/tick.h>

namespace palpate::haptics {

std::string_view name(Task task) noexcept
{
    switch (task) {
        case Task::h2:
            return "H2";
        case Task::h3:
            return "H3";
        case Task::h4:
            return "H4";
        case Task::deform:
            return "deform";
        case Task::h6:
            return "H6";
        case Task::h7:
            return "H7";
        case Task::h5:
            return "H5";
        case Task::count:
            break;
    }
    return "?";
}

std::string_view name(EventKind kind) noexcept
{
    switch (kind) {
        case EventKind::contact:
            return "contact";
        case EventKind::release:
            return "release";
        case EventKind::puncture:
            return "puncture";
        case EventKind::warning:
            return "warning";
        case EventKind::vitalTouch:
            return "vital touch";
        case EventKind::fire:
            return "fire";
        case EventKind::fault:
            return "fault";
    }
    return "?";
}

}  // namespace palpate::haptics
