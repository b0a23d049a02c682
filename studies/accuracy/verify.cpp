#include <base/mapped.h>
#include <studies/accuracy/deep.h>

#include <base/error.h>
#include <command/json.h>
#include <command/progress.h>
#include <studies/accuracy/kernel_verification.h>
#include <studies/accuracy/references.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <stdexcept>
#include <string>

namespace palpate::studies {

using nlohmann::json;

namespace {

json rowOf(const KernelVerification& v)
{
    json row{{"solver", "elastic"}, {"problem", v.problem},     {"quantity", v.quantity},      {"setting", v.setting},
             {"ours", v.ours},      {"reference", v.reference}, {"error_pct", v.errorPercent}, {"bound_pct", v.bound},
             {"order", nullptr},    {"source", v.source},       {"holds", v.holds()}};
    if (v.order != 0.0) {
        row["order"] = v.order;
    }
    return row;
}

// Rows of palpate-reference --verify, through a file of its own.
json referenceRows(command::Progress& progress)
{
    progress.clear();
    const auto file = std::filesystem::temp_directory_path() / fmt::format("palpate-verify-{}.json", getpid());
    const int status = runReferenceProgram({"--verify", "--json", file.string()});
    std::ifstream in(file);
    const json written = json::parse(in, nullptr, false);
    in.close();
    std::error_code ignored;
    std::filesystem::remove(file, ignored);
    base::failIf(!written.is_object() || !written.contains("verification"),
                 "palpate-reference --verify gave no figures (exit status {})", status);
    json rows = written["verification"];
    for (json& row : rows) {
        row["solver"] = "reference";
        row["holds"] = std::abs(row.value("error_pct", 0.0)) <= row.value("bound_pct", 0.0);
    }
    return rows;
}

std::string text(const json& row, const char* key)
{
    const auto found = row.find(key);
    return found != row.end() && found->is_string() ? found->get<std::string>() : "";
}

void printForms(const json& rows)
{
    fmt::print("{:<10} {:<44} {:<16} {:<22} {:>11} {:>11} {:>9} {:>8} {:>6}\n", "solver", "problem", "quantity", "setting",
               "computed", "closed form", "error", "bound", "order");
    for (const json& row : rows) {
        const double order = row.contains("order") && row["order"].is_number() ? row["order"].get<double>() : 0.0;
        fmt::print("{:<10} {:<44} {:<16} {:<22} {:>11.5g} {:>11.5g} {:>8.2f}% {:>7.2g}% {:>6} {}\n", text(row, "solver"),
                   text(row, "problem"), text(row, "quantity"), text(row, "setting"), row.value("ours", 0.0),
                   row.value("reference", 0.0), row.value("error_pct", 0.0), row.value("bound_pct", 0.0),
                   order != 0.0 ? fmt::format("{:.1f}", order) : "", row["holds"].get<bool>() ? "" : "OVER");
    }
}

}  // namespace

void verifyCommand(bool quick, const std::filesystem::path& file)
{
    command::Progress progress;
    json rows = base::mapped<json>(verifyKernel(quick, [&](const std::string& what) { progress.show(what); }), rowOf);
    const bool both = !referenceProgram().empty();
    std::string missing = both ? "" : "palpate-reference was not built (-DPALPATE_REFERENCE=ON): its rows are missing";
    try {
        for (json& row : both ? referenceRows(progress) : json::array()) {
            rows.push_back(std::move(row));
        }
    } catch (const std::runtime_error& e) {
        missing = e.what();  // the kernel's rows are worth having all the same
    }
    progress.clear();
    if (file != "-") {
        printForms(rows);
        if (!both) {
            fmt::print("{}\n", missing);
        }
    }
    command::writeJson(file, {{"verification", rows}, {"chart", json::array()}});
    const auto over = std::ranges::count(rows, false, [](const json& row) { return row["holds"].get<bool>(); });
    base::failIf(both && !missing.empty(), "{}", missing);
    base::failIf(over > 0, "{} of {} rows are over their bounds: see the table", over, rows.size());
}

}  // namespace palpate::studies
