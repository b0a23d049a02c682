#include <studies/commands.h>

#include <base/child_process.h>
#include <base/error.h>
#include <base/outputs.h>
#include <base/window_size.h>
#include <command/json.h>
#include <command/options.h>
#include <haptics/broadcast.h>
#include <session/open.h>
#include <studies/tick/bench_tick.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

namespace palpate::studies {

namespace {

namespace fs = std::filesystem;

struct ViewArguments {
    std::string scene = "breast";
    std::vector<int> sides{128, 256};
    std::vector<std::string> layouts{"trainee"};
    int width = 800;
    int height = 600;
    int frames = 150;
    session::SceneChanges changes;
    bool alone = false;
    bool ultrasound = false;
    std::string json;
};

// A wave through as much of the body as the channel holds: nodes around the middle of the planned line.
class Wave {
public:
    explicit Wave(const haptics::SessionModel& model) : grid_(model.lattice.grid)
    {
        const Vec3 middle = 0.5 * (model.approach.entry + model.approach.aim);
        double radius = 0.5 * glm::length(grid_.box().high - grid_.box().low);
        for (constexpr double less = 0.97; nodes_.empty() || nodes_.size() > channel::maxDisplaced; radius *= less) {
            nodes_.clear();
            for (std::size_t n = 0; n < grid_.count(); ++n) {
                if (glm::distance(grid_.position(grid_.node(n)), middle) < radius) {
                    nodes_.push_back(static_cast<std::uint32_t>(n));
                }
            }
        }
    }

    double fraction() const { return static_cast<double>(nodes_.size()) / static_cast<double>(grid_.count()); }

    void at(double time, channel::Displaced& out) const
    {
        constexpr double amplitude = 1.5e-3;  // [m]
        constexpr double length = 30e-3;      // [m]
        constexpr double turn = 6.283185307179586;
        out.count = static_cast<std::uint32_t>(nodes_.size());
        for (std::uint32_t i = 0; i < out.count; ++i) {
            const Vec3 p = grid_.position(grid_.node(nodes_[i]));
            const auto up = static_cast<float>(amplitude * std::sin(turn * (p.x / length + time)));
            out.nodes[i] = {nodes_[i], {0.0F, up, 1e-6F}};
        }
    }

private:
    volume::NodeGrid grid_;
    std::vector<std::uint32_t> nodes_;
};

// The servo loop of the same scene in a thread of its own, as `train` runs it.
class ServoBeside {
public:
    explicit ServoBeside(const haptics::SessionModel& model)
        : thread_([this, &model] {
              const haptics::RealTimeClaim claim;
              warnings = claim.warnings();
              do {
                  timing = benchTick(model, {true, 0.0, 0}).all;
                  lateness.push_back(timing.lateness.percentiles().p99);
                  ticks += timing.ticks;
                  missed += timing.missed;
              } while (!stop_);
          })
    {
    }
    ~ServoBeside() { end(); }

    void end()
    {
        stop_ = true;
        if (thread_.joinable()) {
            thread_.join();
        }
    }

    // p99, of the worst session [us]
    double latenessP99() const { return 1e6 * *std::max_element(lateness.begin(), lateness.end()); }
    double missedShare() const { return static_cast<double>(missed) / static_cast<double>(missed + ticks); }

    std::vector<std::string> warnings;
    haptics::ServoTiming timing;   // of the last session
    std::vector<double> lateness;  // p99 of each session [s]
    std::uint64_t ticks = 0, missed = 0;

private:
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

// Publishes the wave until the viewer has ended. Returns its exit status.
int publishWave(channel::Publisher& publisher, const haptics::SessionModel& model, const Wave& wave,
                base::ChildProcess& viewer)
{
    constexpr auto tick = std::chrono::milliseconds(1);
    constexpr std::uint64_t longest = 120'000;  // [ticks]
    channel::State state;
    const auto triple = [](Vec3 v) { return channel::Triple{v.x, v.y, v.z}; };
    const Vec3 line = model.approach.aim - model.approach.entry;
    const auto start = std::chrono::steady_clock::now();
    for (std::uint64_t n = 1; n < longest; ++n) {
        state.tick = n;
        state.time = 1e-3 * static_cast<double>(n);
        state.tip = state.proxy = triple(model.approach.entry + (0.5 + 0.4 * std::sin(state.time)) * line);
        state.axis = triple(glm::normalize(line));
        state.phase = channel::Phase::inserted;
        state.inserted = 0.5 * glm::length(line);
        if (n % channel::frameTicks == 1) {
            wave.at(state.time, publisher.backBuffer());
            publisher.backBuffer().tick = n;
            publisher.publishDisplaced();
        }
        publisher.setState(state);
        std::this_thread::sleep_until(start + n * tick);
        constexpr std::uint64_t look = 50;
        if (n % look == 0) {
            if (const int status = viewer.wait(-1.0); status >= 0 || viewer.killed()) {
                return status;
            }
        }
    }
    return -1;
}

nlohmann::json readFigures(const fs::path& file)
{
    std::ifstream in(file);
    auto figures = nlohmann::json::parse(in, nullptr, false);
    fs::remove(file);
    base::failIf(figures.is_discarded(), "palpate-view wrote no figures: install it beside palpate, and install xvfb");
    return figures;
}

nlohmann::json measure(const ViewArguments& o, const haptics::SessionModel& model, int side, const std::string& layout)
{
    const auto count = static_cast<std::size_t>(side) * static_cast<std::size_t>(side) * static_cast<std::size_t>(side);
    const Vec3 extent = model.tissue->box().high - model.tissue->box().low;
    const double finest = 0.9 * std::cbrt(extent.x * extent.y * extent.z / static_cast<double>(count));
    const auto display = volume::affordableGrid(model.tissue->box(), finest, count);
    const std::string session = fmt::format("bench-view-{}", getpid());
    auto publisher = haptics::publisherOf(session, model, false, display);
    const Wave wave(model);
    std::unique_ptr<ServoBeside> servo;
    if (!o.alone) {
        servo = std::make_unique<ServoBeside>(model);
    }
    const fs::path file = fs::temp_directory_path() / (session + ".json");
    std::vector<std::string> words{"--session",
                                   session,
                                   "--hidden",
                                   "--layout",
                                   layout,
                                   "--size",
                                   fmt::format("{}x{}", o.width, o.height),
                                   "--frames",
                                   fmt::format("{}", o.frames),
                                   "--json",
                                   file.string()};
    if (o.ultrasound) {
        words.emplace_back("--ultrasound");
    }
    base::ChildProcess viewer((base::programFolder() / "palpate-view").string(), words, "build it with PALPATE_VIEWER=ON");
    base::failIf(publishWave(publisher, model, wave, viewer) != 0,
                 "palpate-view did not finish its pictures: see its message above");
    auto figures = readFigures(file);
    nlohmann::json result{{"display", {display.size.x, display.size.y, display.size.z}},
                          {"side", side},
                          {"layout", layout},
                          {"width", o.width},
                          {"height", o.height},
                          {"moving_share", wave.fraction()},
                          {"renderer", figures["display"]},
                          {"frames", figures["frames"]},
                          {"frames_per_second", figures["frames_per_second"]},
                          {"frame_ms_p50", figures["frame_ms_p50"]},
                          {"frame_ms_p90", figures["frame_ms_p90"]}};
    if (o.ultrasound) {
        result["ultrasound"] = figures.value("ultrasound", nlohmann::json::object());
    }
    if (servo) {
        servo->end();
        result["lateness_us_p99"] = servo->latenessP99();
        result["missed_share"] = servo->missedShare();
        result["tick_us_p50"] = 1e6 * servo->timing.work.percentiles().p50;
        result["warnings"] = servo->warnings;
    }
    return result;
}

// Of the scanner: pictures a second if it had a core for itself, and where its time goes.
void printScans(const nlohmann::json& c)
{
    const auto scans = c.find("ultrasound");
    if (scans == c.end() || !scans->contains("ms_p90")) {
        return;
    }
    fmt::print("{:>8} {:<10} {:>9.1f} {:>9.1f} {:>9.1f}   first {:.0f} ms;", "", "ultrasound",
               (*scans)["ms_p50"].get<double>(), (*scans)["ms_p90"].get<double>(), 1e3 / (*scans)["ms_p50"].get<double>(),
               (*scans)["first_ms"].get<double>());
    for (const auto& [name, ms] : (*scans)["stages_ms"].items()) {
        fmt::print(" {} {:.1f}", name, ms.get<double>());
    }
    fmt::print(" ms\n");
}

void benchView(const ViewArguments& o)
{
    base::checkOutput(o.json);
    const bool tell = o.json != "-";
    if (tell) {
        fmt::print(
            "a picture of {} x {} pixels, everything deforming in every frame; the servo loop's lateness beside it\n"
            "{:>8} {:<10} {:>9} {:>9} {:>9} {:>9} {:>10}\n",
            o.width, o.height, "voxels", "layout", "p50 [ms]", "p90 [ms]", "frames/s", "late [us]", "missed [%]");
    }
    nlohmann::json result{{"scene", o.scene}, {"cores", std::thread::hardware_concurrency()}};
    const auto model = session::openSession(o.scene, o.changes);
    if (!o.alone) {
        ServoBeside unseen(model);
        unseen.end();  // after one session
        result["without_viewer"] = {{"lateness_us_p99", unseen.latenessP99()}, {"missed_share", unseen.missedShare()}};
        if (tell) {
            fmt::print("{:>8} {:<10} {:>9} {:>9} {:>9} {:>9.1f} {:>10.2f}\n", "none", "", "", "", "", unseen.latenessP99(),
                       100 * unseen.missedShare());
            std::fflush(stdout);
        }
    }
    auto cases = nlohmann::json::array();
    for (const int side : o.sides) {
        for (const auto& layout : o.layouts) {
            const auto c = measure(o, model, side, layout);
            if (tell) {
                fmt::print("{:>6}^3 {:<10} {:>9.1f} {:>9.1f} {:>9.1f} {:>9.1f} {:>10.2f}\n", side, layout,
                           c["frame_ms_p50"].get<double>(), c["frame_ms_p90"].get<double>(),
                           c["frames_per_second"].get<double>(), c.value("lateness_us_p99", 0.0),
                           100 * c.value("missed_share", 0.0));
                printScans(c);
                std::fflush(stdout);
            }
            cases.push_back(c);
        }
    }
    if (!o.json.empty()) {
        result["cases"] = cases;
        command::writeJson(o.json, result);
    }
}

}  // namespace

void addBenchView(CLI::App& bench)
{
    auto o = std::make_shared<ViewArguments>();
    auto* view = bench.add_subcommand("view",
                                      "Measure the time per picture of a viewer (on a hidden display) while all tissue "
                                      "deforms, and the lateness of a servo loop beside it");
    view->add_option("SCENE", o->scene, "Built-in scene, scene file (.toml) or volume (.vdb)")->capture_default_str();
    view->add_option("--voxels", o->sides, "Voxels along each side of the display volume")
        ->delimiter(',')
        ->check(CLI::Range(16, 512))
        ->capture_default_str();
    view->add_option("--layout", o->layouts, "Layouts: trainee, instructor or both")
        ->delimiter(',')
        ->check(CLI::IsMember({"trainee", "instructor"}))
        ->capture_default_str();
    command::addNumber(*view, "--width", o->width, "Of the picture [pixels]", base::leastSide, base::mostSide);
    command::addNumber(*view, "--height", o->height, "Of the picture [pixels]", base::leastSide, base::mostSide);
    command::addNumber(*view, "--frames", o->frames, "Pictures per case", 10, 100000);
    command::addSetting(*view, o->changes);
    view->add_flag("--alone", o->alone, "Run without a servo loop, for comparison");
    view->add_flag("--ultrasound", o->ultrasound,
                   "Show the ultrasound picture, and measure its processor time and that of its stages");
    view->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    view->final_callback([o] { benchView(*o); });
}

}  // namespace palpate::studies
