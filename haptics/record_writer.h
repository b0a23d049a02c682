#pragma once

// What the writer of a record (recorder.cpp) puts into its tables; no public header.

#include <haptics/record_format.h>
#include <haptics/record_seal.h>

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace palpate::haptics::format {

using Results = std::vector<std::pair<std::string, std::string>>;

/// A row of a table of keys and values.
void insertPair(Database& database, const char* table, std::string_view key, const auto& value, RowDigest* digest = nullptr)
{
    Statement row(database, std::string("INSERT INTO ") + table + " VALUES (?, ?)");
    row.digestInto(digest);
    row.bindAll(key, value);
    row.run();
}

/// The prepared statements of a session, and the digests of what they write.
class Writer {
public:
    /// `begun`: the seal of the small tables when the record was made.
    Writer(Database& database, const TickColumns& columns, std::vector<SealedPart> begun);

    void write(const TickRecord& record);
    /// Marks the record complete and seals what was written here: what another program has written into it since then is
    /// found as a change.
    void close(std::uint64_t lost, const Results& results);

private:
    void writeCore(std::uint64_t tick, const CoreSample& core);
    void seal(const std::vector<SealedPart>& ended);

    Database& database_;
    TickColumns columns_;
    std::vector<SealedPart> begun_, results_;
    std::map<std::string, int> resultKeys_;
    RunningSeal seal_;
    Statement tick_, event_, core_, fraction_;
};

}  // namespace palpate::haptics::format
