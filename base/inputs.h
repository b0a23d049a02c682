#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace palpate::base {

/// Why `file` cannot be read as a file, as the end of a message ("there is no such file: check the name", "is a named pipe,
/// not a file: ..."); "" where it can. Never opens it: opening a pipe would wait for a writer.
std::string whyNoFile(const std::filesystem::path& file);

/// All bytes of a file; nothing where it cannot be opened or read (a folder can be opened).
std::optional<std::string> contentOf(const std::filesystem::path& file);

/// What a folder has with that ending (".png"), sorted by name; nothing where it cannot be read.
std::vector<std::filesystem::path> filesWith(const std::string& ending, const std::filesystem::path& folder);

/// Throws std::runtime_error where `file` is none, or has over 16 MB, more than `kind` ("a settings file") can have.
void checkTable(const std::filesystem::path& file, const char* kind);

/// An error of the file system as a message of ours, "FILE: what is wrong": what() of the standard library's is no
/// sentence.
std::string inWords(const std::filesystem::filesystem_error& error);

}  // namespace palpate::base
