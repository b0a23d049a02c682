#include <datasets/scene.h>

#include <base/error.h>
#include <base/mapped.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace palpate::datasets {

namespace {

struct Setting {
    std::string_view name;
    double spacing;  // [m]
    int window;
    int cycles;
};

constexpr ElasticSettings standard;
constexpr std::array<Setting, 3> settings{{
    {"fast", 4e-3, 9, 1},
    {"default", standard.spacing, standard.window, standard.cycles},
    {"fine", 1.5e-3, 19, 2},
}};

}  // namespace

std::vector<std::string> elasticSettings()
{
    return base::mapped<std::string>(settings, &Setting::name);
}

ElasticSettings elasticSetting(const std::string& name, const ElasticSettings& base)
{
    for (const Setting& setting : settings) {
        if (name == setting.name) {
            ElasticSettings out = base;
            out.spacing = setting.spacing;
            out.window = setting.window;
            out.cycles = setting.cycles;
            return out;
        }
    }
    throw base::error("setting '{}': there is none; there are {}", name, fmt::join(elasticSettings(), ", "));
}

}  // namespace palpate::datasets
