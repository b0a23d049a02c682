#pragma once

#include <gtest/gtest.h>

#include <sqlite3.h>

#include <filesystem>
#include <string>

namespace palpate::tests {

/// Runs statements on a database file; the test fails where they do.
inline void executeSql(const std::filesystem::path& file, const std::string& sql)
{
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(file.c_str(), &database), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK)
        << sql << ": " << sqlite3_errmsg(database);
    sqlite3_close(database);
}

}  // namespace palpate::tests
