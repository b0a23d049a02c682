#include <studies/accuracy/log.h>

#include <base/error.h>

#include <algorithm>
#include <fstream>
#include <utility>

namespace palpate::studies {

using nlohmann::json;

AccuracyLog::AccuracyLog(std::filesystem::path file, std::string build) : file_(std::move(file)), build_(std::move(build))
{
    if (file_.empty() || !std::filesystem::exists(file_)) {
        return;
    }
    std::ifstream in(file_);
    base::failIf(!in, "{}: cannot be read: check its permissions", file_.native());
    for (std::string line; std::getline(in, line);) {
        json parsed = json::parse(line, nullptr, false);
        const bool whole = parsed.is_object() && parsed.value("build", json()).is_string() &&
                           parsed.value("reference", json()).is_string() && parsed.value("entry", json()).is_object();
        if (whole && parsed["build"] == build_) {
            lines_.push_back(std::move(parsed));
        }
    }
}

const json* AccuracyLog::find(const std::string& reference, const std::string& method, const std::string& setting) const
{
    // From the end: what was run again counts as it was the last time.
    const auto found = std::find_if(lines_.rbegin(), lines_.rend(), [&](const json& line) {
        const json& entry = line["entry"];
        return line["reference"] == reference && entry.value("method", json()) == method &&
               entry.value("setting", json()) == setting;
    });
    return found != lines_.rend() ? &(*found)["entry"] : nullptr;
}

void AccuracyLog::add(const std::string& reference, const json& entry)
{
    lines_.push_back({{"build", build_}, {"reference", reference}, {"entry", entry}});
    if (file_.empty()) {
        return;
    }
    // A line that was cut short ends here, so that this one stands alone.
    std::ofstream out(file_, std::ios::app);
    std::ifstream before(file_, std::ios::binary | std::ios::ate);
    bool ended = true;
    if (before.tellg() > 0) {
        before.seekg(-1, std::ios::end);
        ended = before.get() == '\n';
    }
    out << (ended ? "" : "\n") << lines_.back().dump(-1, ' ', false, json::error_handler_t::replace) << std::endl;
    base::failIf(!out, "{}: cannot be written: check the folder and the space on the disk", file_.native());
}

}  // namespace palpate::studies
