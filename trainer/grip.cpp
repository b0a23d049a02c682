#include <trainer/grip.h>

#include <array>
#include <fstream>
#include <utility>

namespace palpate::trainer {

GripLine gripLine(std::string_view line)
{
    constexpr std::array<std::pair<std::string_view, Press>, 4> buttons{
        {{"forward", Press::activate}, {"right", Press::next}, {"left", Press::previous}, {"centre", Press::back}}};
    const std::string_view kind = line.substr(0, line.find(' '));
    for (const auto& [name, press] : buttons) {
        if (kind == "button" && line.substr(kind.size()) == " " + std::string(name)) {
            return {press, std::nullopt};
        }
    }
    if (kind == "ready:" || kind == "waiting:") {
        return {std::nullopt, kind == "ready:"};
    }
    return {};
}

Grip::Grip(std::filesystem::path programs, std::filesystem::path log) : programs_(std::move(programs)), log_(std::move(log))
{
}

void Grip::listen(const std::string& firmware)
{
    if (command_ && firmware != firmware_) {
        letGo();
    }
    if (command_) {
        return;
    }
    std::vector<std::string> words{"devices", "--buttons"};
    if (!firmware.empty()) {
        words.insert(words.end(), {"--falcon-firmware", firmware});
    }
    read_ = 0;
    firmware_ = firmware;
    command_.emplace(programs_ / "palpate", words, log_);
}

std::vector<Press> Grip::heard()
{
    std::vector<Press> presses;
    if (!command_) {
        return presses;
    }
    std::ifstream in(log_);
    in.seekg(read_);
    for (std::string line; std::getline(in, line) && !in.eof();) {  // a line without its end is still being written
        read_ = in.tellg();
        const GripLine told = gripLine(line);
        ready_ = told.ready.value_or(ready_);
        if (told.press) {
            presses.push_back(*told.press);
        }
    }
    ready_ = ready_ && !command_->ended();
    return presses;
}

}  // namespace palpate::trainer
