#pragma once

#include <filesystem>
#include <string>
#include <vector>

// Inside volume/import/ only: headers of text.
namespace palpate::volume {

/// Without white space at its ends.
std::string trimmed(const std::string& text);
std::string lowerCase(std::string text);

/// What can be put on a terminal and into UTF-8 files, on one line: control characters become spaces, and bytes that are
/// not UTF-8 are taken as Latin-1.
std::string printable(const std::string& text);

/// The numbers of "1 2 3"; `what` ("DimSize") names them in the refusal of anything else, and of numbers that are not
/// finite.
std::vector<double> numbers(const std::filesystem::path& file, const std::string& what, const std::string& text);
/// Whole numbers of up to 18 digits.
std::vector<std::int64_t> integers(const std::filesystem::path& file, const std::string& what, const std::string& text);
std::int64_t integer(const std::filesystem::path& file, const std::string& what, const std::string& text);

/// A data file that a header names, beside the header; refuses what is not there. Where only NAME.gz is, that is taken,
/// with a warning.
std::filesystem::path besides(const std::filesystem::path& header, const std::string& name,
                              std::vector<std::string>& warnings);

}  // namespace palpate::volume
