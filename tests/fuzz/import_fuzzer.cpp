// libFuzzer: the bytes are a file whose name ends in PALPATE_FUZZ_ENDING.
#include <volume/import.h>

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t count)
{
    static const std::filesystem::path file =
        std::filesystem::temp_directory_path() / ("palpate-fuzz-" + std::to_string(::getpid()) + PALPATE_FUZZ_ENDING);
    std::ofstream(file, std::ios::binary).write(reinterpret_cast<const char*>(bytes), static_cast<std::streamsize>(count));
    try {
        palpate::volume::importLabels(file);
    } catch (const std::runtime_error&) {
        // A refusal; anything else ends the fuzzer.
    }
    try {
        palpate::volume::importImage(file);
    } catch (const std::runtime_error&) {
    }
    return 0;
}
