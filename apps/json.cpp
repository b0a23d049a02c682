#include <apps/command.h>

#include <nlohmann/json.hpp>

#include <fstream>
#include <iostream>
#include <stdexcept>

namespace palpate::apps {

void writeJson(const std::filesystem::path& file, const nlohmann::json& figures)
{
    if (file == "-") {
        std::cout << figures.dump(2) << '\n';
        return;
    }
    std::ofstream out(file);
    out << figures.dump(2) << '\n';
    out.close();
    if (!out) {
        throw std::runtime_error(file.string() + ": cannot be written: check the folder and the space on the disk");
    }
}

}  // namespace palpate::apps
