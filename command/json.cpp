#include <command/json.h>

#include <base/error.h>
#include <base/outputs.h>

#include <nlohmann/json.hpp>

#include <iostream>

namespace palpate::command {

// The text is there before the file is opened: figures that cannot be written down leave the file as it was. A name that is
// not UTF-8 (a file's may be anything) is no reason to fail.
void writeJson(const std::filesystem::path& file, const nlohmann::json& figures)
{
    if (file.empty()) {
        return;
    }
    const std::string text = figures.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + '\n';
    if (file == "-") {
        base::failIf(!(std::cout << text << std::flush), "standard output: the figures cannot be written");
        return;
    }
    base::writeWhole(file, text);
}

}  // namespace palpate::command
