#include <apps/command.h>
#include <base/build.h>
#include <base/mapped.h>
#include <base/outputs.h>
#include <command/json.h>

#include <base/error.h>
#include <haptics/record_check.h>
#include <haptics/replay.h>
#include <session/figures.h>
#include <session/open.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <memory>
#include <string>
#include <vector>

namespace palpate::apps {

namespace {

struct ReplayArguments {
    std::string file;
    std::string json;
};

nlohmann::json differenceFigures(const haptics::ReplayResult& result)
{
    return base::mapped<nlohmann::json>(result.differences, [](const haptics::Difference& d) {
        return nlohmann::json{{"what", d.what},
                              {"first_tick", d.firstTick},
                              {"ticks", d.ticks},
                              {"recorded", d.recorded},
                              {"recomputed", d.recomputed}};
    });
}

// What is wrong with the record, beside what its format and its build have to do with it; empty: nothing.
std::string faultsOf(const std::string& file, const haptics::Record& record, const haptics::ReplayResult& result,
                     const haptics::RecordCheck& check)
{
    std::vector<std::string> faults;
    if (check.seal.state == haptics::Seal::State::broken) {
        faults.push_back("was changed after it was closed: " + haptics::someOf(check.seal.changed));
    }
    if (!result.identical) {
        const bool forces = result.largestDifference > 0;
        faults.push_back(fmt::format("{} from tick {} on: {}: {}",
                                     forces ? fmt::format("forces differ, by up to {:.3g} N,", result.largestDifference)
                                            : "what was recorded differs",
                                     *result.firstDifference, haptics::whyItDiffers(file, base::build()), result.inWords));
    }
    for (const auto& [key, value] : record.results()) {
        if (key == "force_hash" && value != session::hexadecimal(result.forceHash)) {
            faults.push_back(fmt::format("the end of the record says that its forces have the hash {}, but they have {}",
                                         value, session::hexadecimal(result.forceHash)));
        }
    }
    return haptics::someOf(faults, faults.size());
}

void replayRecord(const ReplayArguments& o)
{
    base::checkOutputs({o.json}, {o.file});
    const haptics::Record record(o.file);
    const auto model = session::reopenSession(o.file, record.info());
    const auto result = haptics::replay(record, model);
    const auto check = haptics::checkRecord(record, base::build());
    const std::string faults = faultsOf(o.file, record, result, check);

    nlohmann::json figures{{"ticks", result.ticks},
                           {"identical", result.identical},
                           {"first_difference_tick", nullptr},
                           {"largest_difference_n", result.largestDifference},
                           {"differences", differenceFigures(result)},
                           {"force_hash", session::hexadecimal(result.forceHash)},
                           {"complete", record.complete()},
                           {"record_sha256", check.seal.sha256},
                           {"changed", check.seal.changed},
                           {"doubts", check.warnings}};
    if (result.firstDifference) {
        figures["first_difference_tick"] = *result.firstDifference;
    }
    command::writeJson(o.json, figures);
    base::failIf(!faults.empty(), "{}: {}", o.file, faults);
    if (o.json == "-") {
        return;
    }
    for (const std::string& warning : check.warnings) {
        fmt::print("{}: {}\n", o.file, warning);
    }
    if (!record.complete()) {
        fmt::print("{}: the session was cut off; what there is of it is replayed\n", o.file);
    }
    fmt::print("{} ticks replayed: all that was recorded is the same, bit for bit (forces {}, seal {})\n", result.ticks,
               session::hexadecimal(result.forceHash),
               check.seal.sha256.empty() ? "none" : check.seal.sha256.substr(0, 16));
}

}  // namespace

void addReplay(CLI::App& app)
{
    auto o = std::make_shared<ReplayArguments>();
    auto* command = app.add_subcommand("replay", "Recompute a record, compare it bit for bit, and check its seal");
    command->add_option("FILE", o->file, "Record of a session (train --record)")->required();
    command->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    command->final_callback([o] { replayRecord(*o); });
}

}  // namespace palpate::apps
