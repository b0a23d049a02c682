#include <base/user_files.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>

namespace palpate::base {

namespace fs = std::filesystem;

namespace {

struct Place {
    const char* variable;
    const char* inHome;
};
constexpr std::array<Place, 3> places{
    {{"XDG_CONFIG_HOME", ".config"}, {"XDG_DATA_HOME", ".local/share"}, {"XDG_CACHE_HOME", ".cache"}}};

}  // namespace

fs::path userFolder(UserFolder kind)
{
    const Place& place = places[static_cast<std::size_t>(kind)];
    if (const char* const named = std::getenv(place.variable); named != nullptr && *named == '/') {
        return fs::path(named) / "palpate";
    }
    const char* const home = std::getenv("HOME");
    return home != nullptr && *home == '/' ? fs::path(home) / place.inHome / "palpate" : fs::path();
}

fs::path trainerSettings()
{
    const fs::path folder = userFolder(UserFolder::config);
    return folder.empty() ? folder : folder / "trainer.json";
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
