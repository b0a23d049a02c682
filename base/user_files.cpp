#include <base/user_files.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <cstdio>
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

fs::path imagesBeside(fs::path record)
{
    return record.replace_extension(".ultrasound");
}

std::string plainName(std::string text)
{
    std::ranges::replace_if(
        text, [](unsigned char c) { return c < 0x80 && std::isalnum(c) == 0; }, '-');
    return text;
}

std::string progressPages(const std::string& person)
{
    const std::string plain = plainName(person);
    // "a b" and "a-b" are two people; FNV-1a tells them apart.
    std::uint32_t sum = 2166136261U;
    for (const char c : person) {
        sum = (sum ^ static_cast<unsigned char>(c)) * 16777619U;
    }
    std::array<char, 10> digits{};
    std::snprintf(digits.data(), digits.size(), "-%08x", sum);
    return "progress-" + plain + (plain == person ? "" : digits.data());
}

}  // namespace palpate::base
