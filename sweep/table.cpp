#include <sweep/table.h>

#include <base/error.h>
#include <base/mapped.h>
#include <datasets/scene_text.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sqlite3.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <system_error>

namespace palpate::sweep {

namespace {

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
    for (const auto& o : plan.outputs) {
        const auto info = std::ranges::find(infos, o.name, &OutputInfo::name);
        out.push_back({o.name, "output", !o.formula.empty() ? "=" + o.formula : info != infos.end() ? info->meaning : ""});
    }
    out.insert(out.end(), {{"error", "case", "empty: the case was done"},
                           {"build", "provenance", "program that ran the case"},
                           {"machine", "timing", "that ran the case"},
                           {"tick_us", "timing", "mean processor time of a tick in contact"},
                           {"case_s", "timing", "processor time of the case"}});
    return out;
}

std::string quoted(const std::string& text)
{
    if (text.find_first_of(",\"\r\n") == std::string::npos) {
        return text;
    }
    std::string out = "\"";
    for (const char c : text) {
        out += c == '"' ? "\"\"" : std::string(1, c);
    }
    return out + "\"";
}

std::string csvCell(const Cell& cell)
{
    return std::visit(
        [](const auto& v) -> std::string {
            using Value = std::decay_t<decltype(v)>;
            if constexpr (std::is_same_v<Value, std::monostate>) {
                return "";
            } else if constexpr (std::is_same_v<Value, std::string>) {
                return quoted(v);
            } else {
                return fmt::format("{}", v);
            }
        },
        cell);
}

std::string identifier(const std::string& name)
{
    return "\"" + name + "\"";
}

// A database that is being written.
class Database {
public:
    explicit Database(const std::filesystem::path& file)
    {
        check(sqlite3_open(file.c_str(), &db_));
        run("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; BEGIN");
    }
    ~Database() { sqlite3_close_v2(db_); }
    Database(const Database&) = delete;
    Database& operator=(const Database&) = delete;

    void run(const std::string& sql) { check(sqlite3_exec(db_, sql.c_str(), nullptr, nullptr, nullptr)); }

    // One row into a table of so many columns.
    void insert(const std::string& table, const std::vector<Cell>& cells)
    {
        if (table != table_) {
            const std::vector<std::string> marks(cells.size(), "?");
            sqlite3_stmt* made = nullptr;
            const std::string sql = fmt::format("INSERT INTO {} VALUES ({})", table, fmt::join(marks, ", "));
            check(sqlite3_prepare_v2(db_, sql.c_str(), -1, &made, nullptr));
            statement_.reset(made);
            table_ = table;
        }
        sqlite3_stmt* const s = statement_.get();
        for (std::size_t i = 0; i < cells.size(); ++i) {
            bind(s, static_cast<int>(i) + 1, cells[i]);
        }
        if (sqlite3_step(s) != SQLITE_DONE) {
            check(sqlite3_errcode(db_));
        }
        check(sqlite3_reset(s));
    }

private:
    struct Finalize {
        void operator()(sqlite3_stmt* s) const { sqlite3_finalize(s); }
    };

    void bind(sqlite3_stmt* s, int at, const Cell& cell)
    {
        if (const auto* const v = std::get_if<std::int64_t>(&cell)) {
            check(sqlite3_bind_int64(s, at, *v));
        } else if (const auto* const d = std::get_if<double>(&cell)) {
            check(sqlite3_bind_double(s, at, *d));
        } else if (const auto* const t = std::get_if<std::string>(&cell)) {
            check(sqlite3_bind_text(s, at, t->c_str(), static_cast<int>(t->size()), SQLITE_TRANSIENT));
        } else {
            check(sqlite3_bind_null(s, at));
        }
    }
    void check(int code)
    {
        if (code != SQLITE_OK) {
            throw std::runtime_error(db_ != nullptr ? sqlite3_errmsg(db_) : "no memory");
        }
    }

    sqlite3* db_ = nullptr;
    std::string table_;
    std::unique_ptr<sqlite3_stmt, Finalize> statement_;
};

void fill(Database& db, const SweepTable& table, const SweepPlan& plan)
{
    const auto names = base::mapped<std::string>(table.columns, [&](const auto& c) { return identifier(c.name); });
    db.run(
        fmt::format("CREATE TABLE results ({}); CREATE TABLE columns (name TEXT, kind TEXT, meaning TEXT); CREATE TABLE "
                    "sweep (key TEXT, value TEXT)",
                    fmt::join(names, ", ")));
    for (const auto& c : table.columns) {
        db.insert("columns", {c.name, c.kind, c.meaning});
    }
    db.insert("sweep", {std::string("name"), plan.name});
    db.insert("sweep", {std::string("plan"), plan.text});
    db.insert("sweep", {std::string("scene"), datasets::sceneText(plan.base)});
    for (const auto& row : table.rows) {
        db.insert("results", row);
    }
    db.run("COMMIT");
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
        for (const auto& p : c.parameters) {
            cells.push_back(cellOf(p));
        }
        for (const double v : row->outputs) {
            cells.push_back(cellOf(v));
        }
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
            Database db(half);
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
