#pragma once

#include <sweep/folder.h>

#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace palpate::sweep {

/// A sweep's results: a row per case that there is, in order. Columns: case, point, repeat, seed, the axes, the outputs,
/// error (empty: done), build; then what differs from run to run: machine, tick_us, case_s.
struct SweepTable {
    using Cell = std::variant<std::monostate, std::int64_t, double, std::string>;
    struct Column {
        std::string name;
        std::string kind;  // "case", "parameter", "output", "provenance" or "timing"
        std::string meaning;
    };
    std::vector<Column> columns;
    std::vector<std::vector<Cell>> rows;
};

SweepTable tableOf(const SweepPlan& plan, const std::vector<std::optional<SweepRow>>& rows);

/// RFC 4180, with a line of column names; numbers in as many digits as give them back, none is empty.
std::string csvText(const SweepTable& table);

/// SQLite: table `results`; `columns` (name, kind, meaning); `sweep` (key, value): plan and scene. The file appears whole
/// or not at all. Throws std::runtime_error.
void writeDatabase(const std::filesystem::path& file, const SweepTable& table, const SweepPlan& plan);

}  // namespace palpate::sweep
