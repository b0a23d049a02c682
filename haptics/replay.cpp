#include <haptics/replay.h>

#include <base/error.h>
#include <base/mapped.h>
#include <haptics/score.h>
#include <haptics/simulation.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <utility>

namespace palpate::haptics {

void ForceHash::add(const TickRecord& record) noexcept
{
    for (const Vec3& f : {record.basic, record.additional, record.total}) {
        hash_.add(f);
    }
}

ReplayDevice::ReplayDevice(const Record& record)
{
    samples_.reserve(record.ticks());
    record.each([&](const TickRecord& tick) { samples_.push_back(tick.device); });
}

DeviceSample ReplayDevice::read() noexcept
{
    if (finished()) {  // who reads on has the last, as of a device that stands
        DeviceSample last = samples_.empty() ? DeviceSample{} : samples_.back();
        last.fresh = false;
        return last;
    }
    return samples_[next_++];
}

ReplayResult replay(const Record& record, const SessionModel& model)
{
    Simulation simulation(model, {1.0 / record.info().rate, {}});
    ReplayResult result;
    ForceHash hash;
    TickComparison comparison(record);
    record.each([&](const TickRecord& then) {
        base::failIf(then.tick != result.ticks,
                     "{}: tick {} is missing: forces depend on every tick, so it cannot be replayed", record.file(),
                     result.ticks);
        const TickRecord& now = simulation.tick(then.device);
        hash.add(now);
        ++result.ticks;
        if (!comparison.add(then, now)) {
            result.largestDifference = std::max(result.largestDifference, glm::distance(now.total, then.total));
            result.firstDifference = result.firstDifference.value_or(then.tick);
        }
    });
    base::failIf(result.ticks == 0, "{}: holds no ticks: there is nothing to replay", record.file());
    result.forceHash = hash.value();
    result.differences = comparison.differences();
    result.inWords = comparison.inWords();
    result.identical = result.differences.empty();
    return result;
}

namespace {

void addRow(base::Fnv& hash, const volume::TissueRow& row)
{
    hash.add(std::array{row.youngsModulus, row.poissonRatio, row.compress, row.stretch, row.shear, row.punctureForce,
                        row.cuttingForce, row.frictionPerMetre, row.stictionPerMetre, row.frictionDamping,
                        row.fixed ? 1.0 : 0.0, row.stiffening});
}

void addVoxels(base::Fnv& hash, const volume::Tissue& tissue)
{
    hash.add(tissue.affine());
    for (const auto& s : tissue.structures()) {
        hash.add(std::array<std::uint64_t, 3>{s.value, s.tissue, s.voxels});
    }
}

}  // namespace

std::string modelHash(const SessionModel& model)
{
    base::Fnv hash;
    for (const auto& row : model.tissue->table().rows) {
        addRow(hash, row);
        if (model.scene.model.relaxation) {
            hash.add(row.relaxation().weights);
        }
        if (model.scene.model.walls) {
            hash.add(std::array{row.wallSpacing, row.wallForce});
        }
    }
    addVoxels(hash, *model.tissue);
    hash.addAll(model.lattice.tissue);
    hash.add(model.lattice.grid.origin);
    hash.add(model.lattice.grid.spacing);
    hash.addAll(model.surface.values);
    hash.addAll(model.youngsModulus.values);
    for (const auto& s : model.structures) {
        hash.addAll(s.distance.values);
    }
    return fmt::format("{:016x}", hash.value);
}

std::string bodyHash(const SessionModel& model)
{
    base::Fnv hash;
    for (const auto& row : model.tissue->table().rows) {
        addRow(hash, row);
    }
    addVoxels(hash, *model.tissue);
    // By the volume's voxels, not by the lattice: where the skin is, and what lies where below it.
    hash.addAll(model.surface.values);
    hash.addAll(model.youngsModulus.values);
    return fmt::format("{:016x}", hash.value);
}

SessionInfo infoOf(const SessionModel& model)
{
    SessionInfo info;
    info.scene = model.scene.name;
    info.sceneText = model.scene.text;
    info.volumeHash = modelHash(model);
    info.model = name(model.scene.model.level);
    info.extra.emplace_back(targetShapeKey, toText(shapeOfTarget(model)));
    info.extra.emplace_back(toolRadiusKey, fmt::format("{:.12g}", 1e3 * model.scene.tool.radius));
    if (model.scene.ct.given()) {
        info.extra.emplace_back(scanDoseKey, fmt::format("{:.12g}", model.scene.ct.doseLength()));
    }
    info.probe = model.scene.probe.kind != datasets::ProbeKind::none;
    for (const auto& s : model.structures) {
        info.structures.push_back(s.name);
        info.warnDistances.push_back(s.warnDistance);
    }
    info.tissues = base::mapped<std::string>(model.tissue->table().rows, &volume::TissueRow::name);
    return info;
}

std::string contradictionIn(const SessionInfo& info, const SessionModel& model)
{
    const SessionInfo own = infoOf(model);
    const auto list = [](const auto& all) { return fmt::format("{}", fmt::join(all, ", ")); };
    struct Said {
        const char* what;
        bool same;
        std::string recorded, own;
    };
    const std::string shape = info.extraOf(targetShapeKey), ownShape = own.extraOf(targetShapeKey);
    const std::string radius = info.extraOf(toolRadiusKey), ownRadius = own.extraOf(toolRadiusKey);
    const std::string dose = info.extraOf(scanDoseKey), ownDose = own.extraOf(scanDoseKey);
    const std::array<Said, 8> all{
        {{"scene", info.scene == own.scene, info.scene, own.scene},
         {"model", info.model == own.model, info.model, own.model},
         {"the list of structures", info.structures == own.structures, list(info.structures), list(own.structures)},
         {"the list of tissues", info.tissues == own.tissues, list(info.tissues), list(own.tissues)},
         {"the list of warning distances [m]", info.warnDistances == own.warnDistances, list(info.warnDistances),
          list(own.warnDistances)},
         {"the target's shape", shape.empty() || shape == ownShape, shape, ownShape},
         {"the tool's radius [mm]", radius.empty() || radius == ownRadius, radius, ownRadius},
         {"the dose of a CT scan [mGy cm]", dose == ownDose, dose, ownDose}}};
    const auto other = std::ranges::find(all, false, &Said::same);
    return other == all.end()
               ? ""
               : fmt::format("{} is '{}' in the record and '{}' by its scene", other->what, other->recorded, other->own);
}

}  // namespace palpate::haptics
