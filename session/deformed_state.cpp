#include <session/deformed_state.h>

#include <base/build.h>
#include <base/error.h>
#include <haptics/broadcast.h>
#include <haptics/record_check.h>
#include <haptics/replay.h>
#include <session/open.h>

#include <tbb/parallel_for.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace palpate::session {

namespace {

// Whether material that was at `rest` is at `p` now, and not the tool or air.
bool holds(const occupancy::Body& body, Vec3 rest, Vec3 p)
{
    return glm::length(rest + occupancy::displacementAt(body, rest) - p) < 0.5 * body.grid.spacing;
}

// The box in which something is not at rest, and where it was [m]; low > high when all is at rest.
volume::Box disturbed(const chainmail::DisplacedLattice& shape)
{
    const volume::NodeGrid& grid = shape.lattice().grid;
    volume::Box box{Vec3(std::numeric_limits<double>::max()), Vec3(std::numeric_limits<double>::lowest())};
    for (const chainmail::Node n : shape.moved()) {
        const Vec3 rest = grid.position(grid.node(n));
        const Vec3 now = rest + Vec3(shape.u()[n]);
        box.low = glm::min(box.low, glm::min(rest, now) - 2.0 * grid.spacing);
        box.high = glm::max(box.high, glm::max(rest, now) + 2.0 * grid.spacing);
    }
    return box;
}

constexpr int reach = 3;  // how many nodes displacements are continued off the tissue

// Gives nodes off the tissue the mean of the neighbours that have a displacement. Programs that interpolate between all
// nodes would mix nothing into the tissue at the skin.
void continueOutwards(const chainmail::Lattice& lattice, std::vector<Vec3f>& u)
{
    const volume::NodeGrid& grid = lattice.grid;
    std::vector<std::uint8_t> has = lattice.tissue;  // not 0 where a node has a displacement
    std::vector<std::pair<std::size_t, Vec3f>> found;
    for (int layer = 0; layer < reach; ++layer) {
        found.clear();
        volume::forEachIndex(Index3(0), grid.size - 1, [&](Index3 n) {
            Vec3f sum(0.0F);
            float count = 0.0F;
            for (int side = 0; side < 6 && has[grid.offset(n)] == 0; ++side) {
                Index3 beside = n;
                beside[side / 2] += side % 2 == 0 ? -1 : 1;
                if (grid.contains(beside) && has[grid.offset(beside)] != 0) {
                    sum += u[grid.offset(beside)];
                    count += 1.0F;
                }
            }
            if (count > 0.0F) {
                found.emplace_back(grid.offset(n), sum / count);
            }
        });
        for (const auto& [node, mean] : found) {
            u[node] = mean;
            has[node] = 1;
        }
    }
}

bool inside(const volume::Box& box, Vec3 p)
{
    return p.x >= box.low.x && p.y >= box.low.y && p.z >= box.low.z && p.x <= box.high.x && p.y <= box.high.y &&
           p.z <= box.high.z;
}

}  // namespace

std::uint64_t tickAt(const haptics::Record& record, const std::string& file, double at)
{
    const double rate = record.info().rate;
    const std::uint64_t ticks = record.ticks();
    base::failIf(ticks == 0, "{}: no tick was recorded: there is no state to export", file);
    const double last = static_cast<double>(ticks - 1) / rate;
    base::failIf(!(at >= 0 && at <= last + 1e-9), "{}: --at {:g}s: the record runs from 0 s to {:g} s", file, at, last);
    return static_cast<std::uint64_t>(std::floor(at * rate + 1e-6));
}

void recompute(const haptics::Record& record, haptics::Simulation& simulation, const std::string& file, std::uint64_t tick,
               const std::function<void(const haptics::TickRecord&)>& each, const std::function<void(double)>& progress)
{
    std::uint64_t next = 0;
    haptics::TickComparison comparison(record);
    record.eachWhile([&](const haptics::TickRecord& then) {
        base::failIf(then.tick != next,
                     "{}: tick {} is missing in the record: what comes after it cannot be "
                     "computed",
                     file, next);
        const haptics::TickRecord& now = simulation.tick(then.device);
        const bool same = comparison.add(then, now);
        if (!same) {
            throw base::error("{}: differs from tick {} on: {}: {}", file, next, haptics::whyItDiffers(file, base::build()),
                              comparison.inWords());
        }
        if (each) {
            each(now);
        }
        if (progress && next % 256 == 0) {
            progress(static_cast<double>(next) / static_cast<double>(tick + 1));
        }
        return next++ < tick;
    });
}

ShownState shownState(const haptics::Record& record, double at, std::optional<std::uint64_t> shapeTick,
                      const std::function<void(double)>& progress)
{
    const std::string& file = record.file();
    const haptics::SessionModel model = reopenSession(file, record.info());
    const std::uint64_t tick = tickAt(record, file, at);
    const std::uint64_t shape = std::min(shapeTick.value_or(tick / channel::frameTicks * channel::frameTicks), tick);
    ShownState shown;
    shown.showing = haptics::showingOf(model, false, haptics::displayGrid(*model.tissue));
    haptics::Simulation simulation(model, {1.0 / record.info().rate, {}});
    const haptics::ServoTiming timing;
    recompute(
        record, simulation, file, tick,
        [&](const haptics::TickRecord& now) {
            haptics::showTick(now, timing, shown.state, simulation.period());
            if (now.tick == shape) {
                haptics::showShape(simulation, *shown.shape);
                shown.shape->tick = shape;
            }
        },
        progress);
    return shown;
}

DeformedState::DeformedState(haptics::Record record, double at, const std::function<void(double)>& progress)
    : record_(std::move(record)), model_(reopenSession(record_.file(), record_.info()))
{
    const std::string& file = record_.file();
    const double rate = record_.info().rate;
    tick_ = tickAt(record_, file, at);
    simulation_ = std::make_unique<haptics::Simulation>(model_, haptics::SimulationOptions{1.0 / rate, {}});
    recompute(record_, *simulation_, file, tick_, {}, progress);
}

volume::LabelImage DeformedState::labels() const
{
    volume::LabelImage image = model_.tissue->labels();
    const volume::Box box = disturbed(shape());
    const occupancy::Body body = shape().body(model_.surface);
    tbb::parallel_for(0, image.size.z, [&](int z) {
        const volume::Tissue::Reader reader(*model_.tissue);
        volume::forEachIndex(Index3(0, 0, z), Index3(image.size.x - 1, image.size.y - 1, z), [&](Index3 n) {
            const Vec3 p = image.affine.toPatient(Vec3(n));
            if (inside(box, p)) {
                const Vec3 rest = occupancy::exactRestPoint(body, p);
                image.values[image.offset(n)] = holds(body, rest, p) ? reader.label(rest) : std::uint16_t{0};
            }
        });
    });
    return image;
}

std::vector<Vec3f> DeformedState::displacement() const
{
    std::vector<Vec3f> out(shape().u().begin(), shape().u().end());
    continueOutwards(shape().lattice(), out);
    for (Vec3f& u : out) {
        u *= 1e3F;
    }
    return out;
}

std::vector<Vec3f> DeformedState::inverse() const
{
    const volume::NodeGrid& grid = model_.lattice.grid;
    const volume::Box box = disturbed(shape());
    const occupancy::Body body = shape().body(model_.surface);
    std::vector<Vec3f> out(grid.count(), Vec3f(0.0F));
    tbb::parallel_for(std::size_t{0}, out.size(), [&](std::size_t i) {
        const Vec3 p = grid.position(grid.node(i));
        if (inside(box, p)) {
            out[i] = Vec3f(1e3 * (occupancy::exactRestPoint(body, p) - p));
        }
    });
    return out;
}

volume::VoxelGrid DeformedState::grid() const
{
    const volume::NodeGrid& grid = model_.lattice.grid;
    return {grid.size, {Mat3(grid.spacing), grid.origin}};
}

}  // namespace palpate::session
