#pragma once

// How the file of a record comes to be and gets its name; for the writer (recorder.cpp), no public header.

#include <haptics/record_seal.h>
#include <haptics/recorder.h>

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::haptics::format {

/// Throws that the record cannot be made.
[[noreturn]] void refuse(const std::string& file, const std::string& why);

/// Makes a record without ticks under another name first, so that the file is there whole or not at all. Returns the seal
/// of its small tables, as they are before any other program can know of it.
std::vector<SealedPart> makeFile(const std::string& file, const SessionInfo& info);

/// Removes what was made here, with its logs.
void removeFile(const std::string& file) noexcept;

/// Which file a name is, so that it can be told whether the name still is that file's.
struct FileId {
    bool there = false;
    dev_t device{};
    ino_t inode{};

    bool operator==(const FileId&) const = default;
};

FileId fileId(const std::filesystem::path& file) noexcept;

}  // namespace palpate::haptics::format
