#pragma once

#include <filesystem>
#include <string>

namespace palpate::base {

/// Why `file` cannot be read as a file, as the end of a message ("there is no such file: check the name", "is a named pipe,
/// not a file: ..."); "" where it can. Never opens it: opening a pipe would wait for a writer.
std::string whyNoFile(const std::filesystem::path& file);

/// An error of the file system as a message of ours, "FILE: what is wrong": what() of the standard library's is no
/// sentence.
std::string inWords(const std::filesystem::filesystem_error& error);

}  // namespace palpate::base
