#include <apps/command.h>

#include <base/outputs.h>
#include <base/spoken.h>
#include <base/utf8.h>
#include <channel/channel.h>
#include <command/json.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

namespace palpate::apps {

namespace {

using nlohmann::json;

struct SessionsArguments {
    std::filesystem::path json;
    double every = 0;  // [s]; 0: once
};

// The vital structure that is nearest now; -1: the scene has none.
int nearestVital(const channel::Scenery& scenery, const channel::State& state)
{
    int nearest = -1;
    for (std::uint32_t i = 1; i < scenery.structures; ++i) {
        if (nearest < 0 || state.distance[i] < state.distance[static_cast<std::size_t>(nearest)]) {
            nearest = static_cast<int>(i);
        }
    }
    return nearest;
}

const char* doing(const channel::State& s)
{
    if (s.status != channel::Status::running) {
        return s.status == channel::Status::finished ? "finished" : "faulted";
    }
    if (s.standing != channel::Standing::no) {
        return "paused";
    }
    constexpr std::array phases{"outside", "touching", "inserted"};
    return phases[static_cast<std::size_t>(s.phase)];
}

json millimetres(double metres)
{
    return std::isfinite(metres) ? json(metres * 1e3) : json();
}

json stateFigures(const std::string& name, const channel::Subscriber& session, const channel::State& s)
{
    constexpr std::array warnings{"none", "near", "very near", "touching"};
    const channel::Scenery& scenery = session.scenery();
    const int vital = nearestVital(scenery, s);
    const auto at = static_cast<std::size_t>(std::max(vital, 0));
    timespec now{};
    ::clock_gettime(CLOCK_MONOTONIC, &now);
    const double age =
        static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec) - 1e-9 * static_cast<double>(s.published);
    return {
        {"session", name},
        {"who", scenery.who.data()},
        {"scene", scenery.scene.data()},
        {"process", session.ownerPid()},
        {"state", doing(s)},
        {"seconds", s.time},
        {"age_s", std::max(age, 0.0)},
        {"inserted_mm", s.inserted * 1e3},
        {"target", scenery.structures > 0 ? base::spoken(scenery.structure[0].data()) : ""},
        {"target_mm", scenery.structures > 0 ? millimetres(s.distance[0]) : json()},
        {"vital", vital >= 0 ? json(base::spoken(scenery.structure[at].data())) : json()},
        {"vital_mm", vital >= 0 ? millimetres(s.distance[at]) : json()},
        {"warning", warnings[static_cast<std::size_t>(s.warning)]},
        {"warned", s.warning != channel::Warning::none ? json(base::spoken(scenery.structure[s.warned].data())) : json()},
        {"force_n", std::hypot(s.total[0], s.total[1], s.total[2])},
        {"cores", s.cores},
        {"last_core_target_pct", s.cores > 0 ? json(s.coreTarget * 100) : json()}};
}

json lookAtAll()
{
    json all = json::array();
    for (const std::string& name : channel::sessions()) {
        std::optional<channel::Subscriber> session;
        try {
            session = channel::Subscriber::attach(name);
        } catch (const std::runtime_error&) {
            continue;  // ended meanwhile, and its name is another version's by now
        }
        const auto state = session ? session->state() : std::nullopt;
        if (state) {
            all.push_back(stateFigures(name, *session, *state));
        }
    }
    return all;
}

std::string inMillimetres(const json& value)
{
    return value.is_number() ? fmt::format("{:.1f}", value.get<double>()) : "-";
}

// Shortened where it is too long for its column. A session's name is not: --session needs the whole.
std::string inColumn(const std::string& text, std::size_t width)
{
    const auto letters = base::charactersOf(text);
    std::string out;
    for (std::size_t i = 0; i < std::min(letters.size(), width); ++i) {
        out += i + 1 == width && letters.size() > width ? "…" : letters[i].bytes;
    }
    return out;
}

void printSessions(const json& all)
{
    if (all.empty()) {
        fmt::print("no session runs\n");
        return;
    }
    constexpr std::size_t who = 14, scene = 16;  // widths of columns
    fmt::print("{:<18} {:<14} {:<16} {:<9} {:>7} {:>9} {:>9} {:>9} {:>6} {:>5}  {}\n", "session", "who", "scene", "state",
               "time s", "inside mm", "target mm", "vital mm", "N", "cores", "warning");
    for (const json& s : all) {
        fmt::print("{:<18} {:<14} {:<16} {:<9} {:>7.1f} {:>9} {:>9} {:>9} {:>6.2f} {:>5}  {}\n",
                   s["session"].get<std::string>(), inColumn(s["who"], who), inColumn(s["scene"], scene),
                   s["state"].get<std::string>(), s["seconds"].get<double>(), inMillimetres(s["inserted_mm"]),
                   inMillimetres(s["target_mm"]), inMillimetres(s["vital_mm"]), s["force_n"].get<double>(),
                   s["cores"].get<int>(),
                   s["warning"] == "none"
                       ? ""
                       : fmt::format("{} ({})", s["warning"].get<std::string>(), s["warned"].get<std::string>()));
    }
}

void listSessions(const SessionsArguments& o)
{
    base::checkOutput(o.json);
    const pid_t parent = ::getppid();  // without it nobody looks any more
    do {
        const json all = lookAtAll();
        command::writeJson(o.json, {{"sessions", all}});
        if (o.json != "-") {
            printSessions(all);
            std::fflush(stdout);
        }
        if (o.every > 0) {
            std::this_thread::sleep_for(std::chrono::duration<double>(o.every));
        }
    } while (o.every > 0 && ::getppid() == parent);
}

}  // namespace

void addSessions(CLI::App& app)
{
    auto o = std::make_shared<SessionsArguments>();
    CLI::App* const c = app.add_subcommand("sessions", "List your running sessions on this machine, with their figures");
    c->add_option("--every", o->every, "Repeat the list at this interval, until Ctrl-C [s] (default: list once)")
        ->check(CLI::Range(0.05, 3600.0));
    c->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    c->final_callback([o] { listSessions(*o); });
}

}  // namespace palpate::apps
