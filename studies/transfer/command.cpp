#include <studies/commands.h>

#include <base/child_process.h>
#include <base/error.h>
#include <base/outputs.h>
#include <base/quantiles.h>
#include <base/quantities.h>
#include <base/temporary_folder.h>
#include <base/window_size.h>
#include <channel/layout.h>
#include <command/json.h>
#include <command/options.h>
#include <session/figures.h>
#include <session/open.h>
#include <session/trainer.h>
#include <studies/transfer/transfer.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace palpate::studies {

namespace {

struct IpcOptions {
    std::string scene = "layered";
    double seconds = 5.0;
    std::string json;
};

// A viewer that opens a window is busy for about so long.
constexpr double setUp = 0.2;        // [s]
constexpr double staleAfter = 5e-3;  // a position is old news [s]

nlohmann::json spread(const std::vector<double>& values, double unit)
{
    return {{"p50", base::lowerQuantile(values, 0.5) * unit},
            {"p99", base::lowerQuantile(values, 0.99) * unit},
            {"max", base::lowerQuantile(values, 1.0) * unit}};
}

nlohmann::json transferFigures(const Transfer& t, const Transfer& late)
{
    base::failIf(t.seconds.empty() || late.seconds.empty(),
                 "no position reached the other process: too little real-time priority, or a busy machine");
    auto figures = spread(t.seconds, 1e6);
    figures["first"] = 1e6 * t.seconds.front();
    figures["received"] = t.seconds.size();
    figures["sent"] = t.sent;
    figures["late_viewer_first"] = 1e6 * late.seconds.front();
    figures["late_viewer_stale"] =
        std::count_if(late.seconds.begin(), late.seconds.end(), [](double s) { return s > staleAfter; });
    return figures;
}

void printTransfer(const char* name, const nlohmann::json& f)
{
    fmt::print("{:<14} {:>9.1f} {:>9.1f} {:>9.1f} {:>9.1f} {:>7}/{:<7} {:>12.1f} {:>8}\n", name, f["first"].get<double>(),
               f["p50"].get<double>(), f["p99"].get<double>(), f["max"].get<double>(), f["received"].get<int>(),
               f["sent"].get<int>(), f["late_viewer_first"].get<double>() / 1e3, f["late_viewer_stale"].get<int>());
}

void benchIpc(const IpcOptions& o)
{
    base::checkOutput(o.json);
    const auto model = session::openSession(o.scene, {});
    nlohmann::json figures{{"scene", o.scene},
                           {"reader", "shared memory: spins from 150 us before a tick is due; pipe: blocked in read()"}};
    const bool tell = o.json != "-";
    if (tell) {
        fmt::print(
            "from a tick to a viewer's process [us]; a viewer that comes 200 ms late: age of its first position [ms],\n"
            "and how many came over 5 ms late\n{:<14} {:>9} {:>9} {:>9} {:>9} {:>7}/{:<7} {:>12} {:>8}\n",
            "", "first", "p50", "p99", "max", "came", "sent", "late: first", "stale");
    }
    for (const auto& [transport, key, name] : {std::tuple(Transport::sharedMemory, "shm_us", "shared memory"),
                                               std::tuple(Transport::namedPipe, "pipe_us", "named pipe")}) {
        const auto ready = measureTransfer(model, {transport, o.seconds, 0.0});
        const auto late = measureTransfer(model, {transport, 5.0 * setUp, setUp});
        figures[key] = transferFigures(ready, late);
        if (tell) {
            printTransfer(name, figures[key]);
        }
    }
    command::writeJson(o.json, figures);
}

struct SyncOptions {
    std::string scene = "find-lump", size = "640x480";
    session::SceneChanges changes;
    double seconds = 15.0;
    std::string json;
};

using channel::frameTicks;

constexpr double frameSeconds = frameTicks * haptics::tickSeconds;

using Picture = TimelinePicture;

// The first picture of tick `tick` or of a later one.
const Picture& firstOf(const std::vector<Picture>& pictures, std::uint64_t tick)
{
    return *std::lower_bound(pictures.begin(), pictures.end(), tick,
                             [](const Picture& p, std::uint64_t t) { return p.tick < t; });
}

nlohmann::json syncFigures(const std::array<std::vector<Picture>, 2>& viewers)
{
    std::vector<double> skew, have;
    std::size_t inTime = 0, same = 0;
    const std::uint64_t from = std::max(viewers[0].front().tick, viewers[1].front().tick);
    const std::uint64_t to = std::min(viewers[0].back().tick, viewers[1].back().tick);
    for (std::uint64_t n = (from / frameTicks + 1) * frameTicks; n <= to; n += frameTicks) {
        const Picture &a = firstOf(viewers[0], n), &b = firstOf(viewers[1], n);
        skew.push_back(std::abs(a.done - b.done));
        same += a.tick / frameTicks == b.tick / frameTicks ? 1 : 0;
        for (const Picture* p : {&a, &b}) {
            // The tick came out so much before the one that the picture shows.
            const double published = p->published - static_cast<double>(p->tick - n) * haptics::tickSeconds;
            have.push_back(p->read - published);
            inTime += have.back() < frameSeconds ? 1 : 0;
        }
    }
    base::failIf(skew.empty(), "the two viewers showed no tick in common: let it run longer (--seconds)");
    const auto rate = [&](const std::vector<Picture>& v) {
        return static_cast<double>(v.size() - 1) / (v.back().done - v.front().done);
    };
    return {{"skew_ms", spread(skew, 1e3)},
            {"frame_ms", 1e3 * frameSeconds},
            {"frames", skew.size()},
            {"same_frame_share", static_cast<double>(same) / static_cast<double>(skew.size())},
            {"state_ms", spread(have, 1e3)},
            {"state_before_next_frame_share", static_cast<double>(inTime) / static_cast<double>(have.size())},
            {"frames_per_second", {rate(viewers[0]), rate(viewers[1])}}};
}

void printSync(const nlohmann::json& f)
{
    const auto& skew = f["skew_ms"];
    const auto& state = f["state_ms"];
    fmt::print(
        "two viewers show the same tick within {:.1f} ms (p50), {:.1f} ms (p99), {:.1f} ms (max); a frame is {:.0f} ms\n",
        skew["p50"].get<double>(), skew["p99"].get<double>(), skew["max"].get<double>(), f["frame_ms"].get<double>());
    fmt::print(
        "a viewer has a frame's state after {:.1f} ms (p50), {:.1f} ms (p99); {:.1f} % of them before the next frame\n",
        state["p50"].get<double>(), state["p99"].get<double>(), 100.0 * f["state_before_next_frame_share"].get<double>());
    fmt::print("{} frames; the viewers drew {:.1f} and {:.1f} pictures a second\n", f["frames"].get<int>(),
               f["frames_per_second"][0].get<double>(), f["frames_per_second"][1].get<double>());
}

// Of the viewers: what they refuse is said here, once and before the session.
void checkSize(const std::string& size)
{
    const auto [width, height] = base::pixelsOf(size).value_or(std::pair(0, 0));
    base::failIf(std::min(width, height) < base::leastSide || std::max(width, height) > base::mostSide,
                 "--size {}: must be WIDTHxHEIGHT, each side {} to {} pixels", size, base::leastSide, base::mostSide);
}

void benchSync(const SyncOptions& o)
{
    base::checkOutput(o.json);
    checkSize(o.size);
    const auto model = session::openSession(o.scene, o.changes);
    const auto info = session::describeSession(model, o.scene, "hand");
    const base::TemporaryFolder scratch("what the viewers write");
    session::TrainOptions options;
    options.session = fmt::format("bench-sync-{}", getpid());
    options.servo = {true, o.seconds, 0};
    session::Trainer trainer(model, info, options);
    std::array<std::vector<Picture>, 2> pictures;
    haptics::ServoTiming timing;
    {
        std::array<std::unique_ptr<base::ChildProcess>, 2> viewers;
        const auto fileOf = [&](std::size_t i) { return scratch / fmt::format("viewer{}.csv", i); };
        for (std::size_t i = 0; i < viewers.size(); ++i) {
            viewers[i] = std::make_unique<base::ChildProcess>(
                base::programFolder() / "palpate-view",
                std::vector<std::string>{"--session", options.session, "--hidden", "--size", o.size, "--wait", "2",
                                         "--timeline", fileOf(i)},
                "build it with -DPALPATE_VIEWER=ON");
        }
        timing = trainer.run().timing;
        constexpr double patience = 20.0;  // [s]
        for (std::size_t i = 0; i < viewers.size(); ++i) {
            base::failIf(viewers[i]->wait(patience) != 0, "a viewer failed: its message is above");
            pictures[i] = readTimeline(fileOf(i));
        }
    }
    auto figures = syncFigures(pictures);
    figures["scene"] = o.scene;
    figures["size"] = o.size;
    figures["servo"] = session::timingFigures(timing);
    if (o.json != "-") {
        printSync(figures);
    }
    command::writeJson(o.json, figures);
}

}  // namespace

void addBenchIpc(CLI::App& bench)
{
    auto o = std::make_shared<IpcOptions>();
    auto* ipc = bench.add_subcommand("ipc",
                                     "Measure the time until a position reaches a viewer's process, through shared memory "
                                     "and through named pipes as in the thesis");
    ipc->add_option("SCENE", o->scene, "Scene of the session")->capture_default_str();
    command::addNumber(*ipc, "--seconds", o->seconds, "Duration of each measurement [s]", 0.1, 60.0);
    ipc->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    ipc->final_callback([o] { benchIpc(*o); });
}

void addBenchSync(CLI::App& bench)
{
    auto o = std::make_shared<SyncOptions>();
    auto* sync = bench.add_subcommand("sync", "Measure the time between two viewers that show the same tick");
    sync->add_option("SCENE", o->scene, "Scene of the session")->capture_default_str();
    command::addSetting(*sync, o->changes);
    command::addNumber(*sync, "--seconds", o->seconds, "Duration of the session [s]", 1.0, 600.0);
    sync->add_option("--size", o->size, "Size of the viewers' windows, WIDTHxHEIGHT [pixels]")->capture_default_str();
    sync->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    sync->final_callback([o] { benchSync(*o); });
}

}  // namespace palpate::studies
