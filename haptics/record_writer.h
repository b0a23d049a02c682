#pragma once

// What the writer of a record (recorder.cpp) puts into its tables; no public header.

#include <haptics/record_format.h>
#include <haptics/record_seal.h>

#include <cstdint>
#include <string>
#include <string_view>

namespace palpate::haptics::format {

/// A row of a table of keys and values.
void insertPair(Database& database, const char* table, std::string_view key, const auto& value)
{
    Statement(database, std::string("INSERT INTO ") + table + " VALUES (?, ?)", key, value).run();
}

/// The prepared statements of a session, and the digests of what they write.
class Writer {
public:
    Writer(Database& database, const TickColumns& columns);

    void write(const TickRecord& record);
    /// Closes the record: what it holds now is what it held when it was written.
    void seal();

private:
    void writeCore(std::uint64_t tick, const CoreSample& core);

    Database& database_;
    TickColumns columns_;
    RunningSeal seal_;
    Statement tick_, event_, core_, fraction_;
};

}  // namespace palpate::haptics::format
