#include <command/json.h>

#include <base/error.h>
#include <base/outputs.h>

#include <nlohmann/json.hpp>

#include <fstream>
#include <iostream>
#include <system_error>

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
    // Whole or not at all; what is there and no file of the disk's (a pipe, /dev/stdout) is written as it is.
    std::error_code none;
    if (!std::filesystem::exists(file, none) || std::filesystem::is_regular_file(file, none)) {
        base::writeWhole(file, text);
        return;
    }
    std::ofstream out(file);
    out << text;
    out.close();
    base::failIf(!out, "{}: cannot be written: check the folder and the space on the disk", file.native());
}

}  // namespace palpate::command
