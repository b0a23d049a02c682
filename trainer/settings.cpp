#include <trainer/settings.h>

#include <base/outputs.h>
#include <base/words.h>
#include <trainer/lists.h>

#include <nlohmann/json.hpp>

#include <exception>

namespace palpate::trainer {

namespace fs = std::filesystem;

Settings readSettings(const fs::path& file)
{
    Settings settings;
    const auto json = parsed(file);
    if (!json.is_object()) {
        return settings;
    }
    const auto take = [&json](const char* key, auto& value) {
        try {
            value = json.value(key, value);
        } catch (const nlohmann::json::exception&) {
            return;
        }
    };
    take("language", settings.language);
    take("palette", settings.palette);
    take("sounds", settings.sounds);
    take("text_scale", settings.textScale);
    take("person", settings.person);
    settings.textScale = settings.textScale >= 0.5 && settings.textScale <= 3 ? settings.textScale : 1;
    settings.palette = settings.palette == "colour-blind" ? settings.palette : "standard";
    return settings;
}

std::string writeSettings(const fs::path& file, const Settings& settings)
{
    const nlohmann::json json{{"language", settings.language},
                              {"palette", settings.palette},
                              {"sounds", settings.sounds},
                              {"text_scale", settings.textScale},
                              {"person", settings.person}};
    if (file.empty()) {
        return std::string("trainer.json") + base::tr(": the settings cannot be kept");
    }
    try {
        base::makeFolders(file.parent_path());
        base::writeWhole(file, json.dump(2) + '\n');
        return "";
    } catch (const std::exception&) {
        return file.string() + base::tr(": the settings cannot be kept");
    }
}

}  // namespace palpate::trainer
