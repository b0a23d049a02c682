#include <trainer/pages.h>

#include <base/said.h>
#include <base/words.h>
#include <trainer/commands.h>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <ctime>
#include <utility>

namespace palpate::trainer {

namespace fs = std::filesystem;
using base::said;
using base::tr;

void Pages::write(const fs::path& programs, std::vector<std::string> words, fs::path base, const fs::path& log)
{
    base_ = std::move(base);
    words.insert(words.end(), {"--html", base_.string() + ".html", "--csv", base_.string() + ".csv", "--xapi",
                               base_.string() + ".xapi.json"});
    command_.emplace(programs / "palpate", words, log);
}

void Pages::take(std::string& told, std::string& notice)
{
    if (command_->failed()) {
        notice = std::string(tr("That did not work:")) + "\n" + command_->message();
    } else {
        told = said(tr("Written to {}: page (.html), table (.csv), xAPI statements (.xapi.json)"), base_.string());
        openPage(base_.string() + ".html");
    }
    command_.reset();
}

fs::path freshFile(const fs::path& base, const std::string& ending)
{
    const std::string dated = fmt::format("{}-{:%Y%m%d-%H%M%S}", base.string(), fmt::localtime(std::time(nullptr)));
    for (int i = 0;; ++i) {
        fs::path file = i == 0 ? dated + ending : fmt::format("{}-{}{}", dated, i, ending);
        if (!fs::exists(file)) {
            return file;
        }
    }
}

}  // namespace palpate::trainer
