#pragma once

#include <channel/layout.h>

#include <cstdint>
#include <string>
#include <vector>

namespace palpate::render {

enum class EventKind : std::uint8_t {
    contact,
    inserted,
    out,
    near,
    veryNear,
    touching,
    fired,
    stopped,
    refused,
    marked,
    unmarked,
    fault,
    finished
};

/// Something that a trainee or an instructor wants to find again.
struct Event {
    double time = 0;  // of the session [s]
    EventKind kind = EventKind::contact;
    // That a warning is about; marked, unmarked: number of the mark; stopped, refused: row of the bone, 0: there is none.
    std::uint32_t structure = 0;
    double target = 0;  // fired: fraction of target tissue; stopped: how far the needle was thrown [m]
};

/// What has happened from one state to the next.
std::vector<Event> eventsBetween(const channel::State& before, const channel::State& now);

/// "touching artery", "core: 83 % target".
std::string words(const Event& event, const channel::Scenery& scenery);

/// A tissue by its row, as it is said to people.
std::string tissueCalled(const channel::Scenery& scenery, std::uint32_t row);

/// A name as the table has it; base::spokenHere() says it to people.
std::string text(const channel::Name& name);

}  // namespace palpate::render
