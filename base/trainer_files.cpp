#include <base/trainer_files.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>

namespace palpate::base {

namespace fs = std::filesystem;

fs::path trainerSettings()
{
    if (const char* const config = std::getenv("XDG_CONFIG_HOME"); config != nullptr && *config == '/') {
        return fs::path(config) / "palpate" / "trainer.json";
    }
    const char* const home = std::getenv("HOME");
    return fs::path(home != nullptr ? home : "/tmp") / ".config" / "palpate" / "trainer.json";
}

std::string plainName(std::string text)
{
    std::ranges::replace_if(
        text, [](unsigned char c) { return c < 0x80 && std::isalnum(c) == 0; }, '-');
    return text;
}

std::string progressPages(const std::string& person)
{
    return plainName("progress-" + person);
}

}  // namespace palpate::base
