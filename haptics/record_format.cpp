#include <haptics/record_format.h>

#include <limits>
#include <stdexcept>

namespace palpate::haptics::format {

std::string columnList(std::size_t structures, int of)
{
    std::string list;
    const TickRecord names;
    eachColumn(
        names, structures,
        [&](const char* column, const auto&) {
            list += list.empty() ? "" : ", ";
            list += column;
        },
        of);
    return list;
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
    if (sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) {
        throw std::runtime_error(sqlite3_errmsg(handle_));
    }
}

Statement::Statement(const Database& database, const std::string& sql) : database_(database.get())
{
    check(sqlite3_prepare_v2(database_, sql.c_str(), -1, &handle_, nullptr));
}

Statement::~Statement()
{
    sqlite3_finalize(handle_);
}

void Statement::bind(int position, std::string_view value)
{
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
}

// SQLite cannot hold "not a number": it stores NULL, which is read back as one.
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
    if (status != SQLITE_OK) {
        throw std::runtime_error(sqlite3_errmsg(database_));
    }
}

}  // namespace palpate::haptics::format
