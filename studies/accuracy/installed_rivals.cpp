#include <studies/accuracy/installed_rivals.h>

#include <studies/accuracy/references.h>

namespace palpate::studies {

namespace {

struct Known {
    const char* name;
    const char* program;  // of ours
    const char* needs;    // another one; "" = none
    const char* setting;
    std::vector<double> spacings;  // [m]
};

const Known known[]{{"bullet", "palpate-rival-bullet", "", "explicit, Poisson 0.45", {6e-3, 4e-3}},
                    {"calculix", "palpate-rival-calculix", "ccx", "quadratic", {12e-3, 8e-3}}};

// A folder's name may hold anything.
std::string quoted(const std::string& text)
{
    std::string out = "'";
    for (const char c : text) {
        out += c == '\'' ? std::string("'\\''") : std::string(1, c);
    }
    return out + "'";
}

}  // namespace

std::vector<Rival> installedRivals()
{
    std::vector<Rival> rivals;
    for (const Known& k : known) {
        const std::filesystem::path program = ourProgram(k.program);
        if (!program.empty() && (*k.needs == '\0' || !ourProgram(k.needs).empty())) {
            rivals.push_back({k.name, quoted(program.string()), k.setting, k.spacings});
        }
    }
    return rivals;
}

}  // namespace palpate::studies
