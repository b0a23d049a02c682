#pragma once

// A tick and its events as rows of numpy arrays.

#include <haptics/tick.h>
#include <python/convert.h>

#include <array>
#include <cstdint>

namespace palpate::python {

/// What Python sees of a tick, in SI units; docs/python.md explains the fields.
struct TickRow {
    std::uint64_t tick;
    std::array<double, 3> position, axis, proxy;                  // [m], unit vector, [m]
    std::array<double, 3> tissueForce, basic, additional, total;  // [N]
    double energy, damped;                                        // [J]
    double inserted;                                              // [m]
    std::array<double, 3> deflection;                             // [m]
    std::array<double, 6> probeMove;                              // press, slide, sweep [m], rock, tilt, turn [rad]
    std::array<double, 3> probeFace, probeAxis, probeLateral;     // [m], unit vectors
    std::array<double, 3> probeForce;                             // [N]
    double needleInBeam;                                          // [m]
    double penetration, residual;                                 // [m]
    double ahead, aheadSpeed;                                     // [m], [m/s]
    std::array<double, haptics::maxStructures> distance;          // [m]
    std::array<double, haptics::maxStructures> aheadDistance;     // [m], infinite where the needle meets none
    std::uint32_t buttons, events, contacts, moved;               // events: bit k is kind k
    std::uint8_t phase, tissue, warning, aheadTissue;             // numbers of names
    std::int8_t nearestVital, warned;                             // numbers of structures; -1: none
    std::uint8_t fresh, fired, faulted, tipInBeam;                // 0 or 1
};

TickRow rowOf(const haptics::TickRecord& tick) noexcept;
/// The type of an array of TickRow in a session of so many structures.
py::dtype tickType(std::size_t structures);

struct EventRow {
    std::uint64_t tick;
    double value;  // by kind, SI
    std::uint8_t kind, tissue;
    std::int8_t structure;  // -1: none
};

EventRow rowOf(std::uint64_t tick, const haptics::Event& event) noexcept;
py::dtype eventType();

/// Rows of `type`, which memory is to be filled in.
py::array rowsOf(const py::dtype& type, std::size_t count);

}  // namespace palpate::python
