#include <apps/command.h>
#include <command/json.h>

#include <haptics/replay.h>
#include <session/figures.h>
#include <session/open.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <memory>
#include <stdexcept>

namespace palpate::apps {

namespace {

struct Options {
    std::string file;
    std::string json;
};

void replayRecord(const Options& o)
{
    const haptics::Record record(o.file);
    const auto model = session::reopenSession(o.file, record.info());
    const auto result = haptics::replay(record, model);

    nlohmann::json figures{{"ticks", result.ticks},
                           {"identical", result.identical},
                           {"first_difference_tick", nullptr},
                           {"largest_difference_n", result.largestDifference},
                           {"force_hash", session::hexadecimal(result.forceHash)},
                           {"complete", record.complete()}};
    if (result.firstDifference) {
        figures["first_difference_tick"] = *result.firstDifference;
    }
    if (!o.json.empty()) {
        command::writeJson(o.json, figures);
    }
    const bool tell = o.json != "-";
    if (tell && !record.complete()) {
        fmt::print("{}: the session was cut off; what there is of it is replayed\n", o.file);
    }
    if (!result.identical) {
        throw std::runtime_error(
            fmt::format("{}: forces differ from tick {} on, by up to {:.3g} N: the record was made "
                        "by another build ({}) or machine",
                        o.file, *result.firstDifference, result.largestDifference, record.info().build));
    }
    if (tell) {
        fmt::print("{} ticks replayed: every force is the same, bit for bit ({})\n", result.ticks,
                   session::hexadecimal(result.forceHash));
    }
}

}  // namespace

void addReplay(CLI::App& app)
{
    auto o = std::make_shared<Options>();
    auto* command = app.add_subcommand("replay", "Recompute every force of a record and compare all bits");
    command->add_option("FILE", o->file, "Record of a session (train --record)")->required();
    command->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    command->final_callback([o] { replayRecord(*o); });
}

}  // namespace palpate::apps
