#include <planner/costs.h>

#include <base/error.h>
#include <base/inputs.h>
#include <base/outputs.h>
#include <command/json.h>
#include <command/progress.h>
#include <session/open.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <memory>

namespace palpate::planner {

namespace {

struct CostsArguments {
    std::string scene = "block";
    bool quick = false;
    std::string json;
};

constexpr std::array<std::pair<const char*, double LawCosts::*>, 4> costKeys{{
    {"slot_ns", &LawCosts::perSlot},
    {"slot_cycle_ns", &LawCosts::perSlotCycle},
    {"contact_ns", &LawCosts::perContact},
    {"contact_cycle_ns", &LawCosts::perContactCycle},
}};

nlohmann::json costFigures(const LawCosts& costs)
{
    nlohmann::json out;
    for (const auto& [key, value] : costKeys) {
        out[key] = costs.*value;
    }
    return out;
}

// By how much predicted times are off, root mean square and worst [%].
struct FitError {
    double rms = 0, worst = 0;
};

FitError fitError(const LawCosts& costs, std::span<const TickSample> samples)
{
    FitError error;
    for (const TickSample& s : samples) {
        const double off = 100.0 * std::abs(tickTime(costs, s.work) / s.microseconds - 1.0);
        error.rms += off * off / static_cast<double>(samples.size());
        error.worst = std::max(error.worst, off);
    }
    error.rms = std::sqrt(error.rms);
    return error;
}

void printLaw(const char* law, const LawCosts& costs, std::span<const TickSample> samples)
{
    for (const TickSample& s : samples) {
        fmt::print("{:<62} {:>8.0f} {:>7.2f} {:>8.0f} {:>8.0f} us {:>8.0f} us\n", s.name, s.work.slots, s.work.cycles,
                   s.work.contacts, s.microseconds, tickTime(costs, s.work));
    }
    const FitError error = fitError(costs, samples);
    fmt::print(
        "{} strain: {:.2f} ns per slot and {:.2f} per cycle, {:.0f} ns per contact and {:.0f} per cycle; off by "
        "{:.1f} % (rms), {:.0f} % at worst\n\n",
        law, costs.perSlot, costs.perSlotCycle, costs.perContact, costs.perContactCycle, error.rms, error.worst);
}

void benchCosts(const CostsArguments& o)
{
    base::checkOutput(o.json);
    session::SceneChanges changes;
    changes.model = "spring";  // the bodies are made here, one per spacing
    command::Progress progress;
    const auto model = session::openSession(o.scene, changes);
    const auto samples = measureTicks(model, o.quick, [&](const std::string& what) { progress.show(what); });
    progress.clear();
    const bool tell = o.json != "-";
    if (tell) {
        fmt::print("{:<62} {:>8} {:>7} {:>8} {:>11} {:>11}\n", "model", "slots", "cycles", "contacts", "measured",
                   "fitted");
    }
    nlohmann::json out{{"scene", o.scene}};
    for (const bool finite : {false, true}) {
        std::vector<TickSample> of;
        std::ranges::copy_if(samples, std::back_inserter(of), [&](const TickSample& s) { return s.finite == finite; });
        const LawCosts costs = fitCosts(of);
        const char* law = finite ? "finite" : "small";
        out[law] = costFigures(costs);
        const FitError error = fitError(costs, of);
        out[law]["fit_rms_pct"] = error.rms;
        out[law]["fit_worst_pct"] = error.worst;
        for (const TickSample& s : of) {
            out["samples"].push_back({{"model", s.name},
                                      {"strain", law},
                                      {"slots", s.work.slots},
                                      {"cycles", s.work.cycles},
                                      {"contacts", s.work.contacts},
                                      {"measured_us", s.microseconds},
                                      {"fitted_us", tickTime(costs, s.work)}});
        }
        if (tell) {
            printLaw(law, costs, of);
        }
    }
    command::writeJson(o.json, out);
}

}  // namespace

PlanCosts loadCosts(const std::filesystem::path& file)
{
    PlanCosts costs;
    const std::string why = base::whyNoFile(file);
    base::failIf(!why.empty(), "{}: {}: 'palpate bench costs --json {}' makes such a file", file.native(), why,
                 file.native());
    std::ifstream in(file);
    const auto json = nlohmann::json::parse(in, nullptr, false);
    for (const auto& [law, to] : {std::pair("small", &costs.small), std::pair("finite", &costs.finite)}) {
        for (const auto& [key, value] : costKeys) {
            const nlohmann::json::json_pointer at(fmt::format("/{}/{}", law, key));
            const auto found = json.is_object() && json.contains(at) ? json.at(at) : nlohmann::json();
            base::failIf(!found.is_number() || !(found.get<double>() >= 0.0),
                         "{}: no number at {}: 'palpate bench costs --json {}' makes such a file", file.native(),
                         at.to_string(), file.native());
            to->*value = found.get<double>();
        }
    }
    return costs;
}

void addBenchCosts(CLI::App& bench)
{
    auto o = std::make_shared<CostsArguments>();
    auto* costs = bench.add_subcommand(
        "costs", "Measure the cost of a tick of level elastic on this machine, per node, contact and cycle");
    costs->add_option("SCENE", o->scene, "Built-in scene, scene file (.toml) or volume (.vdb)")->capture_default_str();
    costs->add_flag("--quick", o->quick, "Measure few models only: seconds");
    costs->add_option("--json", o->json, "Write figures to this file (- = standard output), for palpate plan --costs");
    costs->final_callback([o] { benchCosts(*o); });
}

}  // namespace palpate::planner
