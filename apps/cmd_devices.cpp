#include <apps/command.h>

#include <base/child_process.h>
#include <base/end_in_order.h>
#include <base/error.h>
#include <base/inputs.h>
#include <base/outputs.h>
#include <base/quantiles.h>
#include <command/interrupted.h>
#include <command/json.h>

#include <session/falcon.h>

#include <haptics/falcon/buttons.h>
#include <haptics/falcon/force_test.h>
#include <haptics/falcon/guardian.h>
#include <haptics/falcon/usb.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <memory>
#include <optional>
#include <vector>

namespace palpate::apps {

namespace {

namespace fs = std::filesystem;

constexpr double slow = 400.0;      // exchanges per second, below which a hub or a cable is in the way
constexpr time_t betweenLooks = 1;  // for a Falcon [s]

struct DevicesArguments {
    session::FalconOptions falcon;
    bool installUdev = false;
    fs::path rules = "/etc/udev/rules.d";
    std::uint64_t exchanges = 0;
    bool forceTest = false, buttons = false;
    std::string json;
};

// What a look at the Falcon itself shows; nothing of what was not asked.
struct State {
    std::optional<bool> running, homed;
    std::string problem;  // why it could not be looked at; empty: it could, or nobody tried
};

struct Exchanges {
    falcon::LinkCounts counts;
    double seconds = 0;
    std::vector<double> roundTrip;  // of those answered [s], sorted
    bool loaded = false;
};

// The rule in this folder; where it is udev's own and there is none, the one that a package brought.
fs::path ruleIn(const fs::path& folder)
{
    const fs::path file = folder / falcon::udevRuleFile;
    const fs::path packaged = base::programFolder().parent_path() / "lib/udev/rules.d" / falcon::udevRuleFile;
    return !fs::exists(file) && folder == DevicesArguments().rules && fs::exists(packaged) ? packaged : file;
}

void installRule(const fs::path& folder)
{
    const fs::path file = folder / falcon::udevRuleFile;
    std::ofstream stream(file);
    stream << falcon::udevRule() << std::flush;
    base::failIf(!stream, "{}: cannot be written ({}): run 'sudo palpate devices --install-udev'", file.native(),
                 std::strerror(errno));
    ::chmod(file.c_str(), 0644);
    // Without udev (a container) the rule waits for it.
    const bool told = std::system(
                          "udevadm control --reload >/dev/null 2>&1 && udevadm trigger --subsystem-match=usb "
                          ">/dev/null 2>&1") == 0;
    fmt::print("{}: written{}; plug the Falcon in again\n", file.string(),
               told ? "" : " (udev does not run here: it is read when it starts)");
}

State look()
{
    const auto wire = falcon::usbTransport();
    falcon::LinkOptions options;
    options.home = false;
    falcon::Link link(*wire, options, [](const std::string&) {});
    const std::atomic<bool> never{false};
    State state;
    try {
        link.connect(never);
        state.running = true;
        state.homed = link.reading().homed == falcon::allHomed;
    } catch (const falcon::Trouble& trouble) {
        if (trouble.cause() == falcon::Cause::firmwareFile) {
            state.running = state.homed = false;
        } else {
            state.problem = trouble.what();
        }
    }
    link.close();
    return state;
}

// Packets there and back, without torque.
Exchanges exchange(const DevicesArguments& o)
{
    const auto wire = falcon::usbTransport();
    falcon::Link link(*wire, session::linkOptions(o.falcon), session::sayForFalcon);
    const std::atomic<bool> never{false};
    link.connect(never);
    Exchanges done;
    done.loaded = link.loaded();
    done.roundTrip.reserve(o.exchanges);
    const double start = wire->now();
    while (link.counts().exchanges < o.exchanges) {
        const double before = wire->now();
        if (link.exchange({})) {
            done.roundTrip.push_back(wire->now() - before);
        } else if (link.lost()) {
            throw base::error("the Falcon {} after {} exchanges: check its cable and power supply",
                              wire->gone() ? "was unplugged" : "stopped answering", done.roundTrip.size());
        }
    }
    done.seconds = wire->now() - start;
    done.counts = link.counts();
    link.rest();
    link.close();
    std::ranges::sort(done.roundTrip);
    return done;
}

void failIfInterrupted()
{
    if (const int signal = base::EndInOrder::signal(); signal != 0) {
        throw command::Interrupted(signal, "interrupted");
    }
}

// A push of 1 N, to be felt. However this program ends meanwhile, no torque is left.
nlohmann::json pushOnce(const DevicesArguments& o)
{
    falcon::Guardian guardian;
    const base::EndInOrder untilItsEnd;
    const auto wire = falcon::usbTransport();
    falcon::Link link(*wire, session::linkOptions(o.falcon), session::sayForFalcon);
    try {
        link.connect(base::EndInOrder::asked());
    } catch (const falcon::Trouble&) {
        failIfInterrupted();
        throw;
    }
    guardian.guard(wire->descriptor());
    const auto test = falcon::testForce(link, *wire, session::sayForFalcon, base::EndInOrder::asked(), guardian);
    guardian.guard(-1);
    link.close();
    failIfInterrupted();
    if (o.json != "-") {
        fmt::print("force test        {}\n", falcon::inWords(test));
    }
    return {{"held", test.held},
            {"complete", test.complete},
            {"peak_n", test.peak},
            {"moved_mm", 1e3 * test.moved},
            {"words", falcon::inWords(test)}};
}

nlohmann::json exchangeFigures(const Exchanges& e)
{
    return {{"answered", e.counts.exchanges},
            {"unanswered", e.counts.unanswered},
            {"implausible", e.counts.implausible},
            {"lost_bytes", e.counts.lostBytes},
            {"firmware_loaded", e.loaded},
            {"rate_hz", static_cast<double>(e.counts.exchanges) / e.seconds},
            {"round_trip_us",
             {{"p50", 1e6 * base::lowerQuantile(e.roundTrip, 0.5)},
              {"p99", 1e6 * base::lowerQuantile(e.roundTrip, 0.99)},
              {"max", 1e6 * e.roundTrip.back()}}}};
}

void printExchanges(const Exchanges& e)
{
    const double rate = static_cast<double>(e.counts.exchanges) / e.seconds;
    fmt::print("{} packets there and back: {:.0f} per second, {:.0f} us (p50), {:.0f} us (p99)\n", e.counts.exchanges, rate,
               1e6 * base::lowerQuantile(e.roundTrip, 0.5), 1e6 * base::lowerQuantile(e.roundTrip, 0.99));
    fmt::print("  {} were not answered, {} not plausible, {} bytes belonged to none\n", e.counts.unanswered,
               e.counts.implausible, e.counts.lostBytes);
    if (rate < slow || 100 * (e.counts.unanswered + e.counts.implausible) > e.counts.exchanges) {
        fmt::print("  this is too slow or too unreliable to feel tissue: plug the Falcon directly into the computer\n");
    }
}

nlohmann::json jsonOf(std::optional<bool> known)
{
    return known ? nlohmann::json(*known) : nlohmann::json(nullptr);
}

nlohmann::json list(const DevicesArguments& o)
{
    const bool quiet = o.json == "-";
    const auto say = [quiet](const std::string& line) { quiet ? void() : fmt::print("{}\n", line); };
    const auto falcons = falcon::listFalcons();
    auto figures = nlohmann::json::array();
    for (const auto& f : falcons) {
        // With the options for an exchange that follows, the look would only take time.
        const bool looked = f.allowed && f.driver.empty() && o.exchanges == 0 && !o.forceTest;
        const State state = looked ? look() : State{};
        say(fmt::format("Novint Falcon on bus {}, address {}", f.bus, f.address));
        say(fmt::format("  may be opened   {}",
                        f.allowed ? "yes" : "no: run 'sudo palpate devices --install-udev', plug it in again"));
        say(fmt::format("  kernel driver   {}",
                        f.driver.empty() ? "none" : f.driver + " (is detached when the Falcon is used)"));
        if (!state.problem.empty()) {
            say("  firmware        cannot be asked: " + state.problem);
        } else if (looked) {
            say(fmt::format("  firmware        {}", !*state.running ? "not loaded: give it with --falcon-firmware FILE"
                                                    : *state.homed  ? "runs, homed"
                                                                    : "runs, not homed yet"));
        }
        figures.push_back({{"bus", f.bus},
                           {"address", f.address},
                           {"node", f.node},
                           {"kernel_driver", f.driver},
                           {"allowed", f.allowed},
                           {"firmware_runs", jsonOf(state.running)},
                           {"homed", jsonOf(state.homed)},
                           {"problem", state.problem}});
    }
    if (falcons.empty()) {
        say("no Falcon is plugged in (USB 0403:cb48): plug in its cable and its power supply");
    }
    const fs::path rule = ruleIn(o.rules);
    const bool there = base::contentOf(rule).value_or("") == falcon::udevRule();
    say(fmt::format("udev rule         {}",
                    there ? rule.string() : "not there: 'sudo palpate devices --install-udev' writes it"));
    nlohmann::json all{{"falcons", figures}, {"udev_rule", {{"file", rule.string()}, {"installed", there}}}};
    if (!o.falcon.firmware.empty()) {
        const auto firmware = falcon::readFirmware(o.falcon.firmware);
        say(fmt::format("firmware          {}: {} bytes", firmware.file, firmware.image.size()));
        all["firmware"] = {{"file", firmware.file}, {"bytes", firmware.image.size()}};
    }
    say("without a Falcon: --device hand (a scripted trainee), --device mouse (in the viewer's window)");
    return all;
}

void printLine(const std::string& line)
{
    fmt::print("{}\n", line);
    std::fflush(stdout);
}

// A line for each button that is pressed at the grip of a Falcon, without a force, as long as the program that has started
// this one runs: "ready: ...", "button NAME", and "waiting: ..." where there is no Falcon or it is no longer there.
// options: its firmware, which is loaded where it does not run.
void printButtons(const session::FalconOptions& options)
{
    falcon::LinkOptions link = session::linkOptions(options);
    link.home = false;
    const base::EndInOrder untilItsEnd;
    const pid_t parent = ::getppid();  // without it nobody listens any more
    const auto ended = [parent] { return base::EndInOrder::asked() || ::getppid() != parent; };
    std::string before;
    while (!ended()) {
        std::string why = "the Falcon stopped answering, or was unplugged";
        try {
            const auto wire = falcon::usbTransport();
            falcon::Link falcon(*wire, link, [](const std::string&) {});
            falcon.connect(base::EndInOrder::asked());
            printLine("ready: the buttons of the Falcon's grip, as they are pressed");
            falcon::watchButtons(
                falcon, *wire, [](std::uint8_t button) { printLine(fmt::format("button {}", falcon::nameOf(button))); },
                ended);
            falcon.close();
            before.clear();
        } catch (const std::exception& e) {
            why = e.what();
        }
        if (why != before && !ended()) {
            printLine("waiting: " + why);
        }
        before = why;
        // A signal ends the sleep.
        timespec pause{betweenLooks, 0};
        ended() ? 0 : ::nanosleep(&pause, nullptr);
    }
    failIfInterrupted();
}

void devices(const DevicesArguments& o)
{
    if (o.installUdev) {
        installRule(o.rules);
        return;
    }
    if (o.buttons) {
        printButtons(o.falcon);
        return;
    }
    base::checkOutput(o.json);
    auto figures = list(o);
    if (o.exchanges > 0) {
        const Exchanges done = exchange(o);
        figures["exchanges"] = exchangeFigures(done);
        if (o.json != "-") {
            printExchanges(done);
        }
    }
    if (o.forceTest) {
        figures["force_test"] = pushOnce(o);
    }
    command::writeJson(o.json, figures);
}

}  // namespace

void addDevices(CLI::App& app)
{
    const auto o = std::make_shared<DevicesArguments>();
    CLI::App* c = app.add_subcommand("devices", "List haptic devices, and what is missing to use them");
    c->add_option("--falcon-firmware", o->falcon.firmware, "Firmware file of the Novint Falcon, from its maker");
    auto* const exchanges =
        c->add_option("--exchanges", o->exchanges,
                      "Exchange this many packets with the Falcon, without force, and print rate and losses")
            ->check(CLI::Range(1, 10000000));
    auto* const buttons = c->add_flag(
        "--buttons", o->buttons,
        "Print a line for each button pressed at the Falcon's grip, until Ctrl-C; no force; waits for a Falcon");
    buttons->excludes(exchanges);
    c->add_flag("--force-test", o->forceTest, "Push the Falcon's grip with 1 N, to be felt")->excludes(buttons);
    auto* install = c->add_flag("--install-udev", o->installUdev,
                                "Write the udev rule that permits access to the Falcon (run as root)");
    c->add_option("--udev-folder", o->rules, "Folder of udev's rules")->capture_default_str();
    c->add_option("--json", o->json, "Write figures to this file (- = standard output)")
        ->excludes(install)
        ->excludes(buttons);
    c->final_callback([o] { devices(*o); });
}

}  // namespace palpate::apps
