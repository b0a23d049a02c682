#include <python/tick_rows.h>

#include <cstddef>
#include <string>

namespace palpate::python {

namespace {

std::array<double, 3> arrayOf(Vec3 v) noexcept
{
    return {v.x, v.y, v.z};
}

std::int8_t structureOf(std::uint8_t index) noexcept
{
    return index == 0xFF ? std::int8_t{-1} : static_cast<std::int8_t>(index);
}

// Fields by name, numpy format and place.
class Fields {
public:
    Fields& add(const char* name, const std::string& format, std::size_t offset)
    {
        names_.append(name);
        formats_.append(format);
        offsets_.append(offset);
        return *this;
    }
    py::dtype type(std::size_t size)
    {
        py::dict all;
        all["names"] = names_;
        all["formats"] = formats_;
        all["offsets"] = offsets_;
        all["itemsize"] = size;
        return py::dtype::from_args(all);
    }

private:
    py::list names_, formats_, offsets_;
};

}  // namespace

TickRow rowOf(const haptics::TickRecord& t) noexcept
{
    TickRow row{};
    row.tick = t.tick;
    row.position = arrayOf(t.device.position);
    row.axis = arrayOf(t.device.axis);
    row.proxy = arrayOf(t.proxy);
    row.tissueForce = arrayOf(t.tissueForce);
    row.basic = arrayOf(t.basic);
    row.additional = arrayOf(t.additional);
    row.total = arrayOf(t.total);
    row.energy = t.energy;
    row.damped = t.damped;
    row.inserted = t.inserted;
    row.deflection = arrayOf(t.deflection);
    const auto& move = t.device.probe;
    row.probeMove = {move.press, move.slide, move.sweep, move.rock, move.tilt, move.turn};
    row.probeFace = arrayOf(t.probeFace);
    row.probeAxis = arrayOf(t.probeAxis);
    row.probeLateral = arrayOf(t.probeLateral);
    row.probeForce = arrayOf(t.probeForce);
    row.needleInBeam = t.needleInBeam;
    row.tipInBeam = t.tipInBeam ? 1 : 0;
    row.penetration = t.penetration;
    row.residual = t.residual;
    row.ahead = t.ahead.tissueDistance;
    row.aheadSpeed = t.ahead.speed;
    row.distance = t.distance;
    row.aheadDistance = t.ahead.structure;
    row.buttons = t.device.buttons;
    for (std::uint32_t i = 0; i < t.eventCount; ++i) {
        row.events |= 1U << static_cast<unsigned>(t.events[i].kind);
    }
    row.contacts = t.contacts;
    row.moved = t.moved;
    row.phase = static_cast<std::uint8_t>(t.phase);
    row.tissue = t.tissue;
    row.warning = static_cast<std::uint8_t>(t.warning);
    row.aheadTissue = t.ahead.tissue;
    row.nearestVital = structureOf(t.nearestVital);
    row.warned = structureOf(t.warned);
    row.fresh = t.device.fresh ? 1 : 0;
    row.fired = t.fired ? 1 : 0;
    row.faulted = t.faulted ? 1 : 0;
    return row;
}

py::dtype tickType(std::size_t structures)
{
    const std::string distances = "(" + std::to_string(structures) + ",)f8";
    return Fields()
        .add("tick", "u8", offsetof(TickRow, tick))
        .add("position", "(3,)f8", offsetof(TickRow, position))
        .add("axis", "(3,)f8", offsetof(TickRow, axis))
        .add("buttons", "u4", offsetof(TickRow, buttons))
        .add("fresh", "?", offsetof(TickRow, fresh))
        .add("proxy", "(3,)f8", offsetof(TickRow, proxy))
        .add("tissue_force", "(3,)f8", offsetof(TickRow, tissueForce))
        .add("basic", "(3,)f8", offsetof(TickRow, basic))
        .add("additional", "(3,)f8", offsetof(TickRow, additional))
        .add("total", "(3,)f8", offsetof(TickRow, total))
        .add("energy", "f8", offsetof(TickRow, energy))
        .add("damped", "f8", offsetof(TickRow, damped))
        .add("phase", "u1", offsetof(TickRow, phase))
        .add("tissue", "u1", offsetof(TickRow, tissue))
        .add("inserted", "f8", offsetof(TickRow, inserted))
        .add("deflection", "(3,)f8", offsetof(TickRow, deflection))
        .add("contacts", "u4", offsetof(TickRow, contacts))
        .add("penetration", "f8", offsetof(TickRow, penetration))
        .add("moved", "u4", offsetof(TickRow, moved))
        .add("residual", "f8", offsetof(TickRow, residual))
        .add("nearest_vital", "i1", offsetof(TickRow, nearestVital))
        .add("warning", "u1", offsetof(TickRow, warning))
        .add("warned", "i1", offsetof(TickRow, warned))
        .add("ahead", "f8", offsetof(TickRow, ahead))
        .add("ahead_tissue", "u1", offsetof(TickRow, aheadTissue))
        .add("ahead_speed", "f8", offsetof(TickRow, aheadSpeed))
        .add("distance", distances, offsetof(TickRow, distance))
        .add("ahead_distance", distances, offsetof(TickRow, aheadDistance))
        .add("events", "u4", offsetof(TickRow, events))
        .add("fired", "?", offsetof(TickRow, fired))
        .add("faulted", "?", offsetof(TickRow, faulted))
        .add("probe_move", "(6,)f8", offsetof(TickRow, probeMove))
        .add("probe_face", "(3,)f8", offsetof(TickRow, probeFace))
        .add("probe_axis", "(3,)f8", offsetof(TickRow, probeAxis))
        .add("probe_lateral", "(3,)f8", offsetof(TickRow, probeLateral))
        .add("probe_force", "(3,)f8", offsetof(TickRow, probeForce))
        .add("needle_in_beam", "f8", offsetof(TickRow, needleInBeam))
        .add("tip_in_beam", "?", offsetof(TickRow, tipInBeam))
        .type(sizeof(TickRow));
}

EventRow rowOf(std::uint64_t tick, const haptics::Event& event) noexcept
{
    return {tick, event.value, static_cast<std::uint8_t>(event.kind), event.tissue, structureOf(event.structure)};
}

py::dtype eventType()
{
    return Fields()
        .add("tick", "u8", offsetof(EventRow, tick))
        .add("kind", "u1", offsetof(EventRow, kind))
        .add("structure", "i1", offsetof(EventRow, structure))
        .add("tissue", "u1", offsetof(EventRow, tissue))
        .add("value", "f8", offsetof(EventRow, value))
        .type(sizeof(EventRow));
}

py::array rowsOf(const py::dtype& type, std::size_t count)
{
    return py::array(type, std::vector<py::ssize_t>{static_cast<py::ssize_t>(count)});
}

}  // namespace palpate::python
