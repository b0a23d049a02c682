#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

namespace palpate::base {

/// Checks before the work begins that it will be possible to write `file` ("" = not asked for, "-" = standard output).
/// Throws std::runtime_error ("FILE: what is wrong and what to do").
void checkOutput(const std::filesystem::path& file);

/// Checks each of `outputs` as checkOutput() does, that no two of them are one file, and that none of them is one of the
/// files that are read, `inputs` ("" = none): it would be replaced, and gone. Throws std::runtime_error.
void checkOutputs(const std::vector<std::filesystem::path>& outputs, const std::vector<std::filesystem::path>& inputs);

/// Refuses "-" among outputs that only go to files. Throws std::runtime_error.
void checkNames(const std::vector<std::filesystem::path>& outputs);

/// As checkOutput() for a folder that is made, with those above it, when it is not there.
void checkOutputFolder(const std::filesystem::path& folder);

/// Makes a folder, with those above it, where it is not there. Returns whether it was made. Throws std::runtime_error.
bool makeFolders(const std::filesystem::path& folder);

/// What will be replaced when `file` is written whole and put in its place: itself, or what it links to.
/// Throws std::runtime_error where that is no file (a device or a pipe would be gone), or a link that leads to itself.
std::filesystem::path replaceable(const std::filesystem::path& file);

/// Writes a file that appears whole or not at all; one that is there is replaced. A device or a pipe is written into.
/// Throws std::runtime_error.
void writeWhole(const std::filesystem::path& file, std::string_view bytes);

}  // namespace palpate::base
