// libFuzzer: the bytes are a file whose name ends in PALPATE_FUZZ_ENDING. DICOM is read here and not in a process of its
// own, so that the fuzzer sees what the file reaches.
#include <volume/import.h>
#include <volume/import/dicom.h>

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>

namespace {

namespace fs = std::filesystem;
namespace volume = palpate::volume;

constexpr std::string_view ending = PALPATE_FUZZ_ENDING;

template <typename Read>
void tryTo(const Read& read)
{
    try {
        read();
    } catch (const std::runtime_error&) {
        // A refusal; anything else ends the fuzzer.
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t count)
{
    static const fs::path file =
        fs::temp_directory_path() / ("palpate-fuzz-" + std::to_string(::getpid()) + PALPATE_FUZZ_ENDING);
    std::ofstream(file, std::ios::binary).write(reinterpret_cast<const char*>(bytes), static_cast<std::streamsize>(count));
    if (ending == ".dcm") {
        tryTo([] { volume::dicomLabels(file, {file}, {}); });
        tryTo([] { volume::dicomImage(file, {file}, {}); });
    } else {
        tryTo([] { volume::importLabels(file); });
        tryTo([] { volume::importImage(file); });
    }
    return 0;
}
