#include <haptics/record_format.h>

#include <base/error.h>

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <locale>
#include <sstream>
#include <stdexcept>

namespace palpate::haptics::format {

// Columns of real numbers have no declared type on purpose: a REAL column would turn -0.0 into the integer 0.
std::vector<std::pair<std::string, std::string>> schema(const SessionInfo& info)
{
    std::ostringstream rate;
    rate.imbue(std::locale::classic());
    rate.precision(17);
    rate << std::showpoint << info.rate;
    return {{"session", "CREATE TABLE session (key TEXT, value)"},
            {"results", "CREATE TABLE results (key TEXT, value TEXT)"},
            {"structures", "CREATE TABLE structures (structure INTEGER PRIMARY KEY, name TEXT, warn_distance_m)"},
            {"tissues", "CREATE TABLE tissues (tissue INTEGER PRIMARY KEY, name TEXT)"},
            {"ticks", "CREATE TABLE ticks (tick INTEGER PRIMARY KEY" +
                          columnList(columnsOf(info)).substr(std::string_view("tick").size()) + ", seconds AS (tick / " +
                          rate.str() + ") VIRTUAL)"},
            {"events",
             "CREATE TABLE events (tick INTEGER, position INTEGER, kind TEXT, structure INTEGER, tissue INTEGER, value)"},
            {"cores",
             "CREATE TABLE cores (tick INTEGER PRIMARY KEY, volume_m3, target_fraction, target_length_m,"
             " notch_start_x_m, notch_start_y_m, notch_start_z_m, notch_end_x_m, notch_end_y_m, notch_end_z_m, fragments)"},
            {"core_fractions", "CREATE TABLE core_fractions (tick INTEGER, tissue INTEGER, fraction)"},
            {"seal", "CREATE TABLE seal (part TEXT PRIMARY KEY, rows INTEGER, sha256 TEXT)"}};
}

std::string columnList(const TickColumns& columns)
{
    std::string list;
    const TickRecord names;
    eachColumn(names, columns, [&](const char* column, const auto&) {
        list += list.empty() ? "" : ", ";
        list += column;
    });
    return list;
}

std::string placeOf(const std::filesystem::path& file)
{
    return std::filesystem::absolute(file).string();
}

std::string uriOf(const std::filesystem::path& file, bool isImmutable)
{
    std::string name = "file:";
    for (const char c : placeOf(file)) {
        const bool special = c == '%' || c == '?' || c == '#';
        name += special ? fmt::format("%{:02X}", static_cast<unsigned char>(c)) : std::string(1, c);
    }
    return name + (isImmutable ? "?immutable=1" : "");
}

Database::Database(const std::string& file, int flags)
{
    if (sqlite3_open_v2(file.c_str(), &handle_, flags, nullptr) != SQLITE_OK) {
        const std::string why = handle_ != nullptr ? sqlite3_errmsg(handle_) : "out of memory";
        sqlite3_close_v2(handle_);
        throw std::runtime_error(why);
    }
    sqlite3_extended_result_codes(handle_, 1);
    sqlite3_busy_timeout(handle_, 2000);
}

Database::~Database()
{
    sqlite3_close_v2(handle_);
}

void Database::execute(const std::string& sql)
{
    const bool failed = sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK;
    base::failIf(failed, "{}", sqlite3_errmsg(handle_));
}

Statement::Statement(const Database& database, const std::string& sql) : database_(database.get())
{
    check(sqlite3_prepare_v2(database_, sql.c_str(), -1, &handle_, nullptr));
}

Statement::~Statement()
{
    sqlite3_finalize(handle_);
}

// SQLite cannot hold "not a number": it stores NULL.
void Statement::bind(int position, double value)
{
    check(sqlite3_bind_double(handle_, position, value));
    if (digest_ != nullptr) {
        std::isnan(value) ? digest_->addNull() : digest_->add(value);
    }
}

void Statement::bind(int position, std::int64_t value)
{
    check(sqlite3_bind_int64(handle_, position, value));
    if (digest_ != nullptr) {
        digest_->add(value);
    }
}

void Statement::bindNull(int position)
{
    check(sqlite3_bind_null(handle_, position));
    if (digest_ != nullptr) {
        digest_->addNull();
    }
}

void Statement::bind(int position, std::string_view value)
{
    if (digest_ != nullptr) {
        digest_->add(value);
    }
    check(sqlite3_bind_text64(handle_, position, value.data(), value.size(), SQLITE_TRANSIENT, SQLITE_UTF8));
}

bool Statement::step()
{
    const int status = sqlite3_step(handle_);
    if (status != SQLITE_ROW && status != SQLITE_DONE) {
        const std::string why = sqlite3_errmsg(database_);
        sqlite3_reset(handle_);
        throw std::runtime_error(why);
    }
    return status == SQLITE_ROW;
}

void Statement::run()
{
    step();
    check(sqlite3_reset(handle_));
    if (digest_ != nullptr) {
        digest_->endRow();
    }
}

void Statement::digestRow(RowDigest& digest) const
{
    for (int column = 0; column < sqlite3_column_count(handle_); ++column) {
        switch (type(column)) {
            case SQLITE_NULL:
                digest.addNull();
                break;
            case SQLITE_INTEGER:
                digest.add(integer(column));
                break;
            case SQLITE_FLOAT:
                digest.add(real(column));
                break;
            default:
                digest.add(text(column));
        }
    }
    digest.endRow();
}

double Statement::real(int column) const
{
    return isNull(column) ? std::numeric_limits<double>::quiet_NaN() : sqlite3_column_double(handle_, column);
}

std::string_view Statement::text(int column) const
{
    const auto* bytes = static_cast<const char*>(sqlite3_column_blob(handle_, column));
    return {bytes != nullptr ? bytes : "", static_cast<std::size_t>(sqlite3_column_bytes(handle_, column))};
}

void Statement::check(int status)
{
    base::failIf(status != SQLITE_OK, "{}", sqlite3_errmsg(database_));
}

}  // namespace palpate::haptics::format
