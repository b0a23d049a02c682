#include <haptics/record_file.h>

#include <base/descriptor.h>
#include <base/error.h>
#include <haptics/record_format.h>
#include <haptics/record_writer.h>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <system_error>

namespace palpate::haptics::format {

namespace {

// A log with something in it; empty: none.
std::string logOf(const std::string& file)
{
    for (const char* suffix : {"-wal", "-journal"}) {
        std::error_code none;
        const auto bytes = std::filesystem::file_size(file + suffix, none);
        if (!none && bytes > 0) {
            return file + suffix;
        }
    }
    return {};
}

void checkName(const std::string& file)
{
    const std::string why = nameTaken(file);
    base::failIf(!why.empty(), "{}: {}", file, why);
}

void writeInfo(Database& database, const SessionInfo& info)
{
    const auto put = [&](std::string_view key, const auto& value) { insertPair(database, "session", key, value); };
    for (const auto& [key, text] : infoTexts) {
        put(key, info.*text);
    }
    put("rate_hz", info.rate);
    put("seed", std::to_string(info.seed));
    for (const auto& [key, value] : info.extra) {
        put("extra." + key, value);
    }
    for (std::size_t i = 0; i < info.structures.size(); ++i) {
        Statement(database, "INSERT INTO structures VALUES (?, ?, ?)", static_cast<std::int64_t>(i), info.structures[i],
                  i < info.warnDistances.size() ? info.warnDistances[i] : 0.0)
            .run();
    }
    for (std::size_t i = 0; i < info.tissues.size(); ++i) {
        Statement(database, "INSERT INTO tissues VALUES (?, ?)", static_cast<std::int64_t>(i), info.tissues[i]).run();
    }
}

// Gives `part` the name `file`, never in another file's place.
void giveName(const std::string& part, const std::string& file)
{
    int failed = ::renameat2(AT_FDCWD, part.c_str(), AT_FDCWD, file.c_str(), RENAME_NOREPLACE) == 0 ? 0 : errno;
    if (failed == EINVAL && !std::filesystem::exists(file)) {  // a file system that cannot refuse by itself
        failed = std::rename(part.c_str(), file.c_str()) == 0 ? 0 : errno;
    }
    if (failed != 0) {
        checkName(file);
        refuse(file, std::strerror(failed));
    }
}

}  // namespace

void removeFile(const std::string& file) noexcept
{
    std::error_code ignored;
    for (const char* suffix : {"", "-wal", "-shm", "-journal"}) {
        std::filesystem::remove(file + suffix, ignored);
    }
}

void refuse(const std::string& file, const std::string& why)
{
    throw base::error("{}: cannot be made: {}", file, why);
}

std::vector<SealedPart> makeFile(const std::string& file, const SessionInfo& info)
{
    checkName(file);
    const std::string part = file + "." + std::to_string(::getpid()) + ".part";
    removeFile(part);
    std::vector<SealedPart> begun;
    try {
        Database database(placeOf(part), SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX);
        database.execute("PRAGMA journal_mode = MEMORY; PRAGMA synchronous = OFF; BEGIN");
        database.execute("PRAGMA application_id = " + std::to_string(applicationId));
        database.execute("PRAGMA user_version = " + std::to_string(version));
        for (const auto& [table, statement] : schema(info)) {
            database.execute(statement);
        }
        writeInfo(database, info);
        begun = sealOfSmallTables(database);
        database.execute("COMMIT; PRAGMA journal_mode = WAL");
    } catch (const std::exception& e) {
        removeFile(part);
        refuse(file, e.what());
    }
    try {
        if (const base::Descriptor made(::open(part.c_str(), O_RDONLY | O_CLOEXEC)); made) {
            ::fsync(*made);  // a log is nothing without its file
        }
        checkName(file);  // a log that lies there would be taken for this record's
        giveName(part, file);
    } catch (const std::exception&) {
        removeFile(part);
        throw;
    }
    return begun;
}

FileId fileId(const std::filesystem::path& file) noexcept
{
    struct stat s {};
    return ::stat(file.c_str(), &s) == 0 ? FileId{true, s.st_dev, s.st_ino} : FileId{};
}

}  // namespace palpate::haptics::format

namespace palpate::haptics {

std::string nameTaken(const std::filesystem::path& file)
{
    const std::string log = format::logOf(file.string());
    std::error_code failed;
    if (std::filesystem::exists(file, failed)) {
        return log.empty() ? "exists already; choose another name or remove it"
                           : "exists already, and " + log + " is part of it; choose another name, or move or remove both";
    }
    if (log.empty()) {
        return {};
    }
    const std::string suffix = log.substr(file.string().size());
    return log + " is there without it: it belongs to a record of that name that was moved, and only both together are " +
           "whole; give it the record's new name and " + suffix + ", or choose another name";
}

}  // namespace palpate::haptics
