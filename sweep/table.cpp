#include <sweep/table.h>

#include <base/error.h>
#include <base/mapped.h>
#include <base/split.h>
#include <datasets/scene_text.h>
#include <haptics/record_format.h>
#include <sweep/plan_checks.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sqlite3.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <system_error>

namespace palpate::sweep {

namespace {

using haptics::format::Database;
using haptics::format::Statement;
using Cell = SweepTable::Cell;

Cell cellOf(const KeyValue& value)
{
    if (const auto* const v = std::get_if<double>(&value)) {
        return *v;
    }
    if (const auto* const v = std::get_if<std::int64_t>(&value)) {
        return *v;
    }
    return toText(value);
}

Cell cellOf(double value)
{
    return std::isfinite(value) ? Cell(value) : Cell();
}

std::vector<SweepTable::Column> columnsOf(const SweepPlan& plan)
{
    std::vector<SweepTable::Column> out{{"case", "case", "number of the case"},
                                        {"point", "case", "number of the point of the design"},
                                        {"repeat", "case", "of the point"},
                                        {"seed", "case", "of every random choice in the case"}};
    for (const auto& a : plan.axes) {
        out.push_back({a.name, "parameter", a.key.empty() ? "for formulas of the plan" : "key " + a.key});
    }
    const auto infos = outputsOf(sweepCase(plan, 0).procedure.kind);
    std::map<std::string, std::string> meanings;
    for (const OutputInfo& info : infos) {
        const auto names = namesOf(info, true);
        meanings[names[0]] = info.meaning;
        meanings[names[1]] = info.name + " of the reference case";
        meanings[names[2]] = "by how much " + info.name + " exceeds that of the reference case [%]";
    }
    for (const auto& o : plan.outputs) {
        out.push_back({o.name, "output", !o.formula.empty() ? "=" + o.formula : meanings[o.name]});
    }
    out.insert(out.end(), {{"error", "case", "empty: the case was done"},
                           {"build", "provenance", "program that ran the case"},
                           {"machine", "timing", "that ran the case"},
                           {"tick_us", "timing", "mean processor time of a tick in contact"},
                           {"case_s", "timing", "processor time of the case"}});
    return out;
}

std::string csvCell(const Cell& cell)
{
    return std::visit(
        [](const auto& v) -> std::string {
            using Value = std::decay_t<decltype(v)>;
            if constexpr (std::is_same_v<Value, std::monostate>) {
                return "";
            } else if constexpr (std::is_same_v<Value, std::string>) {
                return base::csvCell(v);
            } else {
                return fmt::format("{}", v);
            }
        },
        cell);
}

void bind(Statement& row, int at, const Cell& cell)
{
    std::visit(
        [&](const auto& v) {
            if constexpr (std::is_same_v<std::decay_t<decltype(v)>, std::monostate>) {
                row.bindNull(at);
            } else {
                row.bind(at, v);
            }
        },
        cell);
}

// Inserts rows into a table of so many columns.
void insert(const Database& db, const std::string& table, std::size_t columns, const std::vector<std::vector<Cell>>& rows)
{
    const std::vector<std::string> marks(columns, "?");
    Statement made(db, fmt::format("INSERT INTO {} VALUES ({})", table, fmt::join(marks, ", ")));
    for (const auto& row : rows) {
        for (std::size_t i = 0; i < columns; ++i) {
            bind(made, static_cast<int>(i) + 1, row[i]);
        }
        made.run();
    }
}

void fill(Database& db, const SweepTable& table, const SweepPlan& plan)
{
    const auto names =
        base::mapped<std::string>(table.columns, [](const auto& c) { return fmt::format("\"{}\"", c.name); });
    db.execute("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; BEGIN");
    db.execute(
        fmt::format("CREATE TABLE results ({}); CREATE TABLE columns (name TEXT, kind TEXT, meaning TEXT); CREATE TABLE "
                    "sweep (key TEXT, value TEXT)",
                    fmt::join(names, ", ")));
    insert(db, "columns", 3, base::mapped<std::vector<Cell>>(table.columns, [](const auto& c) {
               return std::vector<Cell>{c.name, c.kind, c.meaning};
           }));
    insert(db, "sweep", 2, {{"name", plan.name}, {"plan", plan.text}, {"scene", datasets::sceneText(plan.base)}});
    insert(db, "results", names.size(), table.rows);
    db.execute("COMMIT");
}

}  // namespace

SweepTable tableOf(const SweepPlan& plan, const std::vector<std::optional<SweepRow>>& rows)
{
    SweepTable table{columnsOf(plan), {}};
    for (const auto& row : rows) {
        if (!row) {
            continue;
        }
        const auto c = sweepPoint(plan, row->index);
        std::vector<Cell> cells{static_cast<std::int64_t>(c.index), static_cast<std::int64_t>(c.point),
                                static_cast<std::int64_t>(c.repeat), static_cast<std::int64_t>(c.seed)};
        std::ranges::transform(c.parameters, std::back_inserter(cells), [](const auto& p) { return cellOf(p); });
        std::ranges::transform(row->outputs, std::back_inserter(cells), [](double v) { return cellOf(v); });
        cells.insert(cells.end(), {row->error, row->build, row->machine, 1e6 * row->tickTime, row->seconds});
        table.rows.push_back(std::move(cells));
    }
    return table;
}

std::string csvText(const SweepTable& table)
{
    std::string out;
    for (std::size_t i = 0; i < table.columns.size(); ++i) {
        out += (i > 0 ? "," : "") + table.columns[i].name;
    }
    out += "\r\n";
    for (const auto& row : table.rows) {
        for (std::size_t i = 0; i < row.size(); ++i) {
            out += (i > 0 ? "," : "") + csvCell(row[i]);
        }
        out += "\r\n";
    }
    return out;
}

void writeDatabase(const std::filesystem::path& file, const SweepTable& table, const SweepPlan& plan)
{
    std::filesystem::path half = file;
    half += ".part";
    std::error_code ignored;
    std::filesystem::remove(half, ignored);
    try {
        {
            Database db(half.string(), SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
            fill(db, table, plan);
        }
        std::filesystem::rename(half, file);
    } catch (const std::exception& e) {
        std::filesystem::remove(half, ignored);
        throw base::error("{}: cannot be written ({}): check the folder and the space on the disk", file.string(),
                          e.what());
    }
}

}  // namespace palpate::sweep
