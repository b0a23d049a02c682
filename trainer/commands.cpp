#include <trainer/commands.h>

#include <base/process.h>
#include <base/words.h>
#include <trainer/lists.h>
#include <trainer/results.h>
#include <trainer/running.h>
#include <trainer/state.h>

#include <unistd.h>

#include <system_error>
#include <utility>

namespace palpate::trainer {

namespace fs = std::filesystem;
using base::tr;

namespace {

constexpr double answerTime = 30;  // of a short command, on a machine that has much to do [s]

std::string whyNot(const Running& command, const std::vector<std::string>& words)
{
    const std::string said = command.message();
    return tr("That did not work:") + ("\n" + (said.empty() ? asTyped("palpate", words) + tr(": no answer") : said));
}

}  // namespace

Commands::Commands(fs::path programs, fs::path scratch) : programs_(std::move(programs)), scratch_(std::move(scratch)) {}

nlohmann::json Commands::answer(std::vector<std::string> words, std::string& notice) const
{
    const fs::path file = scratch_ / "answer.json";
    fs::remove(file);
    words.insert(words.end(), {"--json", file.string()});
    Running command(programs_ / "palpate", words, scratch_ / "answer.log");
    command.finish(answerTime);
    auto answer = parsed(file);
    notice = answer.is_discarded() ? whyNot(command, words) : notice;
    return answer;
}

bool Commands::did(const std::vector<std::string>& words, std::string& notice) const
{
    Running command(programs_ / "palpate", words, scratch_ / "short.log");
    const bool done = command.finish(answerTime) && !command.failed();
    notice = done ? "" : whyNot(command, words);
    return done;
}

std::string aboutProfiles(const std::string& said)
{
    const std::string why = said.empty() ? "" : whyNoProfiles();
    return why.empty() ? said : why;
}

fs::file_time_type writtenAt(const fs::path& file) noexcept
{
    std::error_code none;
    const auto at = fs::last_write_time(file, none);
    return none ? fs::file_time_type::min() : at;
}

void openPage(const fs::path& page)
{
    if (fs::exists(page) && ::access("/usr/bin/xdg-open", X_OK) == 0) {
        base::start({{"/usr/bin/xdg-open", page.string()}, {-1, -1, -1}, true});
    }
}

}  // namespace palpate::trainer
