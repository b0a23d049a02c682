#pragma once

// The seal of a record: SHA-256 of the rows of its tables, part by part. Shared by the writer (recorder.cpp) and the reader
// (record.cpp), no public header.

#include <bit>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

struct evp_md_ctx_st;

namespace palpate::haptics::format {

class Database;
struct TickColumns;

/// SHA-256 of rows: each value with its type, each row with its end.
class RowDigest {
public:
    RowDigest();

    void add(std::int64_t value) { addBits('i', static_cast<std::uint64_t>(value)); }
    void add(double value) { addBits('r', std::bit_cast<std::uint64_t>(value)); }
    void add(std::string_view text);
    void addNull() { addBytes("n", 1); }
    void endRow();

    std::int64_t rows() const noexcept { return rows_; }
    /// Of the rows so far, in hexadecimal.
    std::string text() const;

private:
    void addBits(char type, std::uint64_t bits);
    void addBytes(const void* bytes, std::size_t count);

    struct Free {
        void operator()(evp_md_ctx_st* context) const noexcept;
    };
    std::unique_ptr<evp_md_ctx_st, Free> context_;
    std::int64_t rows_ = 0;
};

/// One line of a seal.
struct SealedPart {
    std::string part;  // "session.scene", "ticks.3000" (and the 999 after it), "events", ..
    std::int64_t rows = 0;
    std::string sha256;

    bool operator==(const SealedPart&) const = default;
};

inline constexpr std::uint64_t ticksPerPart = 1000;
inline constexpr const char* wholeRecord = "record";  // the part that all others are digested into

/// Digests of the tables that grow while a session runs, as their rows are written.
class RunningSeal {
public:
    /// Where the row of this tick goes, and the rows of the other tables.
    RowDigest& ticks(std::uint64_t tick);
    RowDigest events, cores, fractions;

    /// Ticks in their parts, events, cores, core_fractions.
    std::vector<SealedPart> parts() const;

private:
    std::vector<SealedPart> full_;
    std::uint64_t part_ = 0;
    std::unique_ptr<RowDigest> filling_;
};

/// The parts of the tables that are written at the beginning and at the end, from the file: tables, session, structures,
/// tissues, results.
std::vector<SealedPart> sealOfSmallTables(Database& database);

/// The part of one row of such a table; `before` counts the keys that there are.
std::string rowPart(std::string_view table, std::string_view key, std::map<std::string, int>& before);

/// The parts of the tables that grow, from the file.
std::vector<SealedPart> sealOfTicks(Database& database, const TickColumns& columns);

/// The digest of all parts.
SealedPart sealOf(const std::vector<SealedPart>& parts);

/// What is in table `seal`, without the last part if that is `wholeRecord`, which goes to `whole`.
std::vector<SealedPart> readSeal(Database& database, SealedPart& whole);

/// What has become of the parts of a seal, in words, part by part.
std::vector<std::string> compareSeals(const std::vector<SealedPart>& sealed, const std::vector<SealedPart>& found);

}  // namespace palpate::haptics::format
