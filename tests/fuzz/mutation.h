#pragma once

#include <cstdint>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

// Real files with faults put into them: whatever the importer says to them, it neither crashes nor hangs nor takes memory
// that the file does not account for.
namespace palpate::fuzz {

/// A file of the test data, with the others that belong to it (the .raw of an .mhd).
struct Seed {
    std::filesystem::path file;
    std::vector<std::filesystem::path> companions;
};

/// Every volume in `folder` and below that has at most `maxBytes`.
std::vector<Seed> seeds(const std::filesystem::path& folder, std::uint64_t maxBytes);

/// One to four faults: bits turned, bytes set, numbers of a text header changed, pieces cut out, doubled or moved, the end
/// cut off. Half of them hit the first 1000 bytes, where the header is.
std::string mutated(std::string bytes, std::mt19937& random);

/// What came of one mutated copy.
struct Outcome {
    bool taken = false;   // as labels or as an image
    std::string refusal;  // the last reason, where it was refused
    std::string fault;    // anything that must not be: a wrong type of exception, a reason of several lines
};

/// Writes the mutated copy of `seed` into `folder` and imports it.
Outcome tryOne(const Seed& seed, std::mt19937& random, const std::filesystem::path& folder);

}  // namespace palpate::fuzz
