#pragma once

// Rows of a record's file as fields of ours, none of them believed; used by the reader (record.cpp), no public header.

#include <base/error.h>
#include <haptics/record_bounds.h>
#include <haptics/record_format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace palpate::haptics::format {

// The row of an enumerator's name; throws on a word that this version does not know.
template <class Enum, std::size_t n>
Enum fromName(std::string_view word, const std::array<std::string_view, n>& names)
{
    const auto found = std::ranges::find(names, word);
    if (found == names.end()) {
        // It stands in a message of one line, and a damaged file may hold anything.
        std::string shown(word.substr(0, 40));
        std::ranges::replace_if(
            shown, [](char c) { return c < 0x20 || c == 0x7F; }, '?');
        throw base::error("unknown word '{}'", shown);
    }
    return static_cast<Enum>(found - names.begin());
}

// A value of the row as the file must have it; throws with the column's name.
inline std::int64_t integerOf(const Statement& row, int column, const char* name, std::int64_t low, std::int64_t high)
{
    base::failIf(row.type(column) != SQLITE_INTEGER, "{} is no whole number", name);
    const std::int64_t value = row.integer(column);
    base::failIf(value < low || value > high, "{} is {}, outside {} to {}", name, value, low, high);
    return value;
}

inline double realOf(const Statement& row, int column, const char* name)
{
    const int type = row.type(column);
    base::failIf(type == SQLITE_TEXT || type == SQLITE_BLOB, "{} is no number", name);
    return row.real(column);
}

inline std::uint8_t optionalIndex(const Statement& row, int column, const char* name)
{
    return row.isNull(column) ? none : static_cast<std::uint8_t>(integerOf(row, column, name, 0, none - 1));
}

inline std::uint64_t tickOf(const Statement& row)
{
    return static_cast<std::uint64_t>(integerOf(row, 0, "tick", 0, static_cast<std::int64_t>(lastTick)));
}

// Reads fields one after another, in the order of eachColumn.
struct Reader {
    const Statement& row;
    int column = -1;

    void operator()(const char* name, double& v) { v = realOf(row, ++column, name); }
    void operator()(const char* name, bool& v) { v = integerOf(row, ++column, name, 0, 1) != 0; }
    void operator()(const char*, std::uint64_t& tick)
    {
        ++column;
        tick = tickOf(row);
    }
    template <class Integer>
    void operator()(const char* name, Integer& v)
    {
        v = static_cast<Integer>(integerOf(row, ++column, name, 0, std::numeric_limits<Integer>::max()));
    }
    void operator()(const char*, Phase& v) { v = fromName<Phase>(row.text(++column), phaseNames); }
    void operator()(const char*, WarningLevel& v) { v = fromName<WarningLevel>(row.text(++column), warningNames); }
    void operator()(const char* name, Microseconds<float> v)
    {
        v.value = static_cast<float>(realOf(row, ++column, name) / 1e6);
    }
    void operator()(const char* name, OptionalIndex<std::uint8_t> v) { v.value = optionalIndex(row, ++column, name); }
};

// Rows of a table beside `ticks`, handed out tick by tick, none of them of a tick that is not there.
class Sidecar {
public:
    Sidecar(const Database& database, std::string table, const std::string& sql)
        : table_(std::move(table)), rows_(database, sql)
    {
        next();
    }

    template <class Visit>
    void take(std::uint64_t tick, Visit&& visit)
    {
        while (tick_ && *tick_ <= tick) {
            if (*tick_ < tick) {
                orphan();
            }
            visit(static_cast<const Statement&>(rows_));
            next();
        }
    }

    /// After the last tick.
    void end() const
    {
        if (tick_) {
            orphan();
        }
    }

private:
    void next() { tick_ = rows_.step() ? std::optional(tickOf(rows_)) : std::nullopt; }
    [[noreturn]] void orphan() const
    {
        throw base::error("table {} has a row of tick {}, which table ticks does not have", table_, *tick_);
    }

    std::string table_;
    Statement rows_;
    std::optional<std::uint64_t> tick_;
};

/// The next event of a tick: tick, kind, structure, tissue, value, position. Throws std::runtime_error, as all of these.
void readEvent(const Statement& row, TickRecord& record);

/// The core of a tick that fired: all columns of table `cores`.
void readCore(const Statement& row, TickRecord& record, bool& found);

/// tick, tissue, fraction.
void readFraction(const Statement& row, TickRecord& record);

}  // namespace palpate::haptics::format
