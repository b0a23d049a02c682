#include <training/belongings.h>

#include <base/outputs.h>
#include <base/user_files.h>
#include <haptics/record_format.h>

#include <nlohmann/json.hpp>

#include <sqlite3.h>

#include <algorithm>
#include <fstream>
#include <optional>
#include <system_error>

namespace palpate::training {

namespace fs = std::filesystem;

namespace {

bool liesIn(const fs::path& file, const fs::path& folder)
{
    const fs::path relative = file.lexically_relative(fs::weakly_canonical(folder));
    return !relative.empty() && *relative.begin() != ".." && *relative.begin() != ".";
}

// Whose session a record is, also of a writer that was killed; empty: nobody's, or no record. Nothing: cannot be read.
std::optional<std::string> operatorOf(const fs::path& file)
{
    try {
        const haptics::format::Database record(file.string(), SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX);
        sqlite3_db_config(record.get(), SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
        sqlite3_db_config(record.get(), SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
        haptics::format::Statement tables(record, "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = 'session'");
        if (!tables.step()) {
            return "";
        }
        haptics::format::Statement ask(record, "SELECT value FROM session WHERE key = 'operator'");
        return ask.step() ? std::string(ask.text(0)) : "";
    } catch (const std::runtime_error&) {
        return std::nullopt;
    }
}

// A file, or a folder of pictures.
void removeOne(const fs::path& file, Erased& erased)
{
    std::error_code failed;
    fs::remove_all(file, failed);
    if (failed) {
        erased.stuck.push_back(file);
    }
}

// What the trainer's window or palpate-view made of a record: a film or pictures, whole, cut off or still being made.
void removeFilms(const fs::path& record, Erased& erased)
{
    for (const char* extension : {".mp4", ".mp4.part", ".part.mp4", ".part.mp4.part", ".pictures", ".part.pictures"}) {
        removeOne(fs::path(record).replace_extension(extension), erased);
    }
}

// The record last: until it is gone it says whose the other files are.
void removeRecord(const fs::path& file, Erased& erased)
{
    for (const char* suffix : {"-wal", "-shm", "-journal"}) {
        removeOne(file.string() + suffix, erased);
    }
    const bool closed = file.extension() == ".db";
    if (closed) {
        removeOne(fs::path(file).replace_extension(".json"), erased);
        removeOne(fs::path(file).replace_extension(".ultrasound"), erased);
        removeFilms(file, erased);
    }
    removeOne(file, erased);
    if (closed) {
        // One that came to its end meanwhile; its writer looks for the record after that, and removes a later one itself.
        removeFilms(file, erased);
    }
}

// A film that is being made ("X.mp4.part", in the window "X.part.mp4.part") goes with the record beside it, or stays with
// it.
bool isFilmOfRecord(const fs::path& part)
{
    fs::path film = part.stem();
    if (film.extension() != ".mp4") {
        return false;
    }
    film = film.stem();
    film.replace_extension(film.extension() == ".part" ? ".db" : film.extension().string() + ".db");
    std::error_code none;
    return fs::exists(part.parent_path() / film, none) || !fs::exists(part, none);
}

// Older versions gave people whose names differ in signs only the same pages, which then stay.
std::string olderPages(const std::string& name)
{
    return base::plainName("progress-" + name);
}

void removePages(const Belongings& of, Erased& erased)
{
    const std::string older = olderPages(of.name);
    const bool shared = std::ranges::any_of(of.otherNames, [&](const std::string& n) { return olderPages(n) == older; });
    for (const fs::path& folder : of.folders) {
        for (const char* suffix : {".html", ".csv", ".xapi.json"}) {
            removeOne(folder / (base::progressPages(of.name) + suffix), erased);
            const fs::path file = folder / (older + suffix);
            std::error_code none;
            if (!shared) {
                removeOne(file, erased);
            } else if (fs::exists(file, none)) {
                erased.shared.push_back(file);
            }
        }
    }
}

bool isOfOthers(const fs::path& file, const Belongings& of)
{
    std::error_code none;
    return of.ofOthers.contains(fs::weakly_canonical(file, none));
}

void removeUnlessShared(const fs::path& file, const Belongings& of, Erased& erased)
{
    if (!isOfOthers(file, of)) {
        removeRecord(file, erased);
    } else if (std::error_code none; fs::exists(file, none)) {
        erased.shared.push_back(file);
    }
}

}  // namespace

Erased removeBelongings(const Belongings& of)
{
    Erased erased;
    for (const fs::path& file : of.known) {
        std::error_code none;
        if (std::ranges::any_of(of.folders, [&](const fs::path& folder) { return liesIn(file, folder); })) {
            removeUnlessShared(file, of, erased);
        } else if (fs::exists(file, none)) {
            erased.elsewhere.push_back(file);
        }
    }
    std::vector<fs::path> found;
    for (const fs::path& folder : of.folders) {
        std::error_code none;
        for (const auto& entry : fs::directory_iterator(folder, none)) {
            const auto ending = entry.path().extension();  // of a record, or of one that was being made
            const bool maybe = ending == ".db" || ending == ".part";
            if (maybe && !of.known.contains(fs::weakly_canonical(entry.path(), none))) {
                found.push_back(entry.path());
            }
        }
    }
    std::ranges::sort(found);
    for (const fs::path& file : found) {
        if (isFilmOfRecord(file)) {
            continue;
        }
        const auto whose = operatorOf(file);
        if (whose == of.name) {
            removeUnlessShared(file, of, erased);
        } else if (!whose && !isOfOthers(file, of)) {
            erased.unclear.push_back(file);
        }
    }
    removePages(of, erased);
    return erased;
}

void forgetLastPerson(const fs::path& settings, const std::string& name)
{
    std::ifstream in(settings);
    auto json = nlohmann::json::parse(in, nullptr, false);
    if (json.is_object() && json.contains("person") && json["person"] == name) {
        json["person"] = "";
        base::writeWhole(settings, json.dump(2) + "\n");
    }
}

}  // namespace palpate::training
