#include "mutation.h"

#include <base/inputs.h>
#include <volume/import.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <set>
#include <stdexcept>

namespace palpate::fuzz {

namespace fs = std::filesystem;

namespace {

std::size_t below(std::size_t n, std::mt19937& random)
{
    return n == 0 ? 0 : random() % n;
}

// A place to hit: mostly where the header is.
std::size_t place(const std::string& bytes, std::mt19937& random)
{
    const bool early = random() % 2 == 0;
    return below(early ? std::min<std::size_t>(1000, bytes.size()) : bytes.size(), random);
}

// A number in the text becomes another one.
void changeNumber(std::string& bytes, std::mt19937& random)
{
    const auto isDigit = [](char c) { return c >= '0' && c <= '9'; };
    const auto start = bytes.begin() + static_cast<std::ptrdiff_t>(place(bytes, random));
    const auto first = std::find_if(start, bytes.end(), isDigit);
    const auto last = std::find_if_not(first, bytes.end(), isDigit);
    static const std::vector<std::string> numbers = {"0",     "-1",  "1",    "3", "65536", "99999999999999999999",
                                                     "1e308", "nan", "32767"};
    bytes.replace(first, last, numbers[below(numbers.size(), random)]);
}

void hit(std::string& bytes, std::mt19937& random)
{
    static const std::string telling("\x00\xff\x7f\x80\x01\n :", 8);
    const std::size_t at = place(bytes, random);
    const std::size_t length = 1 + below(std::min<std::size_t>(64, bytes.size() - at), random);
    switch (random() % 8) {
        case 0:
            bytes[at] = static_cast<char>(bytes[at] ^ (1 << random() % 8));
            break;
        case 1:
            bytes[at] = static_cast<char>(random());
            break;
        case 2:
            bytes[at] = telling[below(telling.size(), random)];
            break;
        case 3:
            std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(at),
                        std::min<std::size_t>(length % 8 + 1, bytes.size() - at), telling[below(telling.size(), random)]);
            break;
        case 4:
            changeNumber(bytes, random);
            break;
        case 5:
            bytes.erase(at, length);
            break;
        case 6:
            bytes.insert(place(bytes, random), bytes.substr(at, length));
            break;
        default:
            if (random() % 4 == 0) {
                bytes.resize(at);
            } else {
                bytes[at] = static_cast<char>(bytes[at] + (random() % 2 == 0 ? 1 : -1));
            }
    }
}

template <typename Import>
void importInto(Outcome& outcome, const Import& import)
{
    try {
        import();
        outcome.taken = true;
    } catch (const std::runtime_error& e) {
        outcome.refusal = e.what();
        if (outcome.refusal.find('\n') != std::string::npos || outcome.refusal.find(": ") == std::string::npos) {
            outcome.fault = "not one line with the file and the reason: " + outcome.refusal;
        }
    } catch (const std::exception& e) {
        outcome.fault = std::string("an exception that is no refusal: ") + e.what();
    }
}

bool contains(const fs::path& file, const char* part)
{
    return file.filename().string().find(part) != std::string::npos;
}

// What a header without voxels may name.
std::vector<fs::path> companionsOf(const fs::path& file, std::uint64_t maxBytes)
{
    std::vector<fs::path> found;
    const std::string ending = file.extension();
    if (ending != ".nhdr" && ending != ".mhd" && ending != ".hdr" && !contains(file, ".hdr.gz")) {
        return found;
    }
    static const std::set<std::string> data = {".raw", ".zraw", ".img"};
    for (const auto& other : fs::directory_iterator(file.parent_path())) {
        const fs::path& path = other.path();
        const bool named = data.count(path.extension()) > 0 || contains(path, ".img.gz") || contains(path, "30x30.nii.gz");
        if (named && other.file_size() <= maxBytes) {
            found.push_back(path);
        }
    }
    return found;
}

}  // namespace

std::vector<Seed> seeds(const fs::path& folder, std::uint64_t maxBytes)
{
    static const std::set<std::string> names = {".nii", ".hdr", ".nrrd", ".nhdr", ".mha",
                                                ".mhd", ".mgz", ".dcm",  ".seg",  ".gz"};
    std::vector<Seed> all;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
        const fs::path& file = entry.path();
        // Siemens names its files CT.1.3.12...
        const bool named = names.count(file.extension()) > 0 || file.filename().string().rfind("CT.", 0) == 0;
        if (!entry.is_regular_file() || !named || entry.file_size() > maxBytes || contains(file, ".raw.gz")) {
            continue;
        }
        all.push_back({file, companionsOf(file, maxBytes)});
    }
    std::sort(all.begin(), all.end(), [](const Seed& a, const Seed& b) { return a.file < b.file; });
    return all;
}

std::string mutated(std::string bytes, std::mt19937& random)
{
    const auto hits = 1 + random() % 4;
    for (unsigned i = 0; i < hits && !bytes.empty(); ++i) {
        hit(bytes, random);
    }
    return bytes;
}

Outcome tryOne(const Seed& seed, std::mt19937& random, const fs::path& folder)
{
    fs::create_directories(folder);
    const fs::path copy = folder / seed.file.filename();
    for (const fs::path& companion : seed.companions) {
        // Now and then the fault is in the data instead of the header.
        const std::string bytes = base::contentOf(companion).value();
        std::ofstream(folder / companion.filename(), std::ios::binary)
            << (random() % 4 == 0 ? mutated(bytes, random) : bytes);
    }
    std::ofstream(copy, std::ios::binary) << mutated(base::contentOf(seed.file).value(), random);
    Outcome outcome;
    importInto(outcome, [&] { volume::importLabels(copy); });
    importInto(outcome, [&] { volume::importImage(copy); });
    return outcome;
}

}  // namespace palpate::fuzz
