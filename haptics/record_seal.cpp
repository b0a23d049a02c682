#include <haptics/record_seal.h>

#include <base/error.h>
#include <haptics/record_format.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <openssl/evp.h>

#include <array>
#include <map>
#include <new>

namespace palpate::haptics::format {

namespace {

SealedPart partOf(std::string name, const RowDigest& digest)
{
    return {std::move(name), digest.rows(), digest.text()};
}

std::string ticksPart(std::uint64_t part)
{
    return fmt::format("ticks.{}", part * ticksPerPart);
}

// One part for each row, which the first column names.
void addRows(Database& database, const std::string& table, const std::string& sql, std::vector<SealedPart>& parts)
{
    std::map<std::string, int> before;
    Statement rows(database, sql);
    while (rows.step()) {
        RowDigest digest;
        rows.digestRow(digest);
        parts.push_back(partOf(rowPart(table, rows.text(0), before), digest));
    }
}

SealedPart wholeTable(Database& database, const std::string& name, const std::string& sql)
{
    RowDigest digest;
    Statement rows(database, sql);
    while (rows.step()) {
        rows.digestRow(digest);
    }
    return partOf(name, digest);
}

// "ticks.3000" as a reader would call it.
std::string inWords(const std::string& part)
{
    const std::string ticks = "ticks.";
    if (!part.starts_with(ticks)) {
        return part;
    }
    const auto first = std::strtoull(part.c_str() + ticks.size(), nullptr, 10);
    return fmt::format("ticks {} to {}", first, first + ticksPerPart - 1);
}

}  // namespace

void RowDigest::Free::operator()(evp_md_ctx_st* context) const noexcept
{
    EVP_MD_CTX_free(context);
}

RowDigest::RowDigest() : context_(EVP_MD_CTX_new())
{
    if (!context_ || EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr) != 1) {
        throw std::bad_alloc();
    }
}

void RowDigest::addBytes(const void* bytes, std::size_t count)
{
    base::failIf(EVP_DigestUpdate(context_.get(), bytes, count) != 1, "SHA-256 cannot be computed");
}

void RowDigest::addBits(char type, std::uint64_t bits)
{
    std::array<unsigned char, 9> bytes{static_cast<unsigned char>(type)};
    for (std::size_t i = 0; i < 8; ++i) {
        bytes[i + 1] = static_cast<unsigned char>(bits >> (8 * i));
    }
    addBytes(bytes.data(), bytes.size());
}

void RowDigest::add(std::string_view text)
{
    addBits('t', text.size());
    addBytes(text.data(), text.size());
}

void RowDigest::endRow()
{
    addBytes("\n", 1);
    ++rows_;
}

std::string RowDigest::text() const
{
    const std::unique_ptr<evp_md_ctx_st, Free> copy(EVP_MD_CTX_new());
    std::array<unsigned char, EVP_MAX_MD_SIZE> bytes{};
    unsigned count = 0;
    base::failIf(!copy || EVP_MD_CTX_copy_ex(copy.get(), context_.get()) != 1 ||
                     EVP_DigestFinal_ex(copy.get(), bytes.data(), &count) != 1,
                 "SHA-256 cannot be computed");
    return fmt::format("{:02x}", fmt::join(bytes.begin(), bytes.begin() + count, ""));
}

RowDigest& RunningSeal::ticks(std::uint64_t tick)
{
    if (!filling_ || tick / ticksPerPart != part_) {
        if (filling_) {
            full_.push_back(partOf(ticksPart(part_), *filling_));
        }
        part_ = tick / ticksPerPart;
        filling_ = std::make_unique<RowDigest>();
    }
    return *filling_;
}

std::vector<SealedPart> RunningSeal::parts() const
{
    std::vector<SealedPart> all = full_;
    if (filling_) {
        all.push_back(partOf(ticksPart(part_), *filling_));
    }
    all.push_back(partOf("events", events));
    all.push_back(partOf("cores", cores));
    all.push_back(partOf("core_fractions", fractions));
    return all;
}

std::vector<SealedPart> sealOfSmallTables(Database& database)
{
    std::vector<SealedPart> parts;
    parts.push_back(wholeTable(database, "tables and indexes",
                               "SELECT type, name, tbl_name, sql FROM sqlite_master WHERE name NOT LIKE 'sqlite\\_%' "
                               "ESCAPE '\\' ORDER BY type, name"));
    addRows(database, "session", "SELECT key, value FROM session ORDER BY rowid", parts);
    addRows(database, "structures", "SELECT structure, name, warn_distance_m FROM structures ORDER BY structure", parts);
    addRows(database, "tissues", "SELECT tissue, name FROM tissues ORDER BY tissue", parts);
    addRows(database, "results", "SELECT key, value FROM results ORDER BY rowid", parts);
    return parts;
}

std::string rowPart(std::string_view table, std::string_view key, std::map<std::string, int>& before)
{
    std::string name = fmt::format("{}.{}", table, key);
    if (const int n = before[name]++; n > 0) {
        name += fmt::format(" ({})", n + 1);  // a key that is there twice
    }
    return name;
}

std::vector<SealedPart> sealOfTicks(Database& database, const TickColumns& columns)
{
    RunningSeal seal;
    Statement ticks(database, "SELECT " + columnList(columns) + " FROM ticks ORDER BY tick");
    while (ticks.step()) {
        ticks.digestRow(seal.ticks(static_cast<std::uint64_t>(ticks.integer(0))));
    }
    std::vector<SealedPart> parts = seal.parts();
    parts.resize(parts.size() - 3);
    parts.push_back(
        wholeTable(database, "events", "SELECT tick, position, kind, structure, tissue, value FROM events ORDER BY rowid"));
    parts.push_back(wholeTable(database, "cores", "SELECT * FROM cores ORDER BY rowid"));
    parts.push_back(
        wholeTable(database, "core_fractions", "SELECT tick, tissue, fraction FROM core_fractions ORDER BY rowid"));
    return parts;
}

SealedPart sealOf(const std::vector<SealedPart>& parts)
{
    RowDigest digest;
    for (const SealedPart& p : parts) {
        digest.add(p.part);
        digest.add(p.rows);
        digest.add(p.sha256);
        digest.endRow();
    }
    return partOf(wholeRecord, digest);
}

std::vector<SealedPart> readSeal(Database& database, SealedPart& whole)
{
    std::vector<SealedPart> parts;
    Statement rows(database, "SELECT part, rows, sha256 FROM seal ORDER BY rowid");
    while (rows.step()) {
        parts.push_back({std::string(rows.text(0)), rows.integer(1), std::string(rows.text(2))});
    }
    if (!parts.empty() && parts.back().part == wholeRecord) {
        whole = parts.back();
        parts.pop_back();
    }
    return parts;
}

std::vector<std::string> compareSeals(const std::vector<SealedPart>& sealed, const std::vector<SealedPart>& found)
{
    std::map<std::string, const SealedPart*> now;
    for (const SealedPart& p : found) {
        now[p.part] = &p;
    }
    std::vector<std::string> changed;
    for (const SealedPart& then : sealed) {
        const auto at = now.find(then.part);
        if (at == now.end()) {
            changed.push_back(inWords(then.part) + " is gone");
            continue;
        }
        if (at->second->rows != then.rows) {
            changed.push_back(
                fmt::format("{}: {} rows where {} were written", inWords(then.part), at->second->rows, then.rows));
        } else if (at->second->sha256 != then.sha256) {
            changed.push_back(inWords(then.part) + " is not what was written");
        }
        now.erase(at);
    }
    for (const SealedPart& p : found) {  // in the order of the file
        if (now.contains(p.part)) {
            changed.push_back(inWords(p.part) + " was added");
        }
    }
    return changed;
}

}  // namespace palpate::haptics::format
