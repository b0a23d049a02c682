#include <apps/train_attempts.h>

#include <base/inputs.h>
#include <base/user_files.h>
#include <base/utc.h>

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

namespace palpate::apps {

namespace fs = std::filesystem;

namespace {

// The ultrasound pictures that are stored beside a record.
std::vector<fs::path> picturesOf(const fs::path& record)
{
    return base::filesWith(".png", base::imagesBeside(record));
}

// @param before  pictures that were there when it began
void forget(const fs::path& record, const std::vector<fs::path>& before)
{
    for (const char* part : {"", "-wal", "-shm", "-journal"}) {
        fs::remove(record.string() + part);
    }
    for (const fs::path& picture : picturesOf(record)) {
        if (!std::ranges::binary_search(before, picture)) {
            fs::remove(picture);
        }
    }
}

}  // namespace

session::TrainResult runToItsEnd(const haptics::SessionModel& model, haptics::SessionInfo& info,
                                 const session::TrainOptions& options)
{
    const auto before = options.record.empty() ? std::vector<fs::path>() : picturesOf(options.record);
    for (;;) {
        session::TrainResult result = session::Trainer(model, info, options).run();
        if (!result.restart || result.signal != 0 || !result.problem.empty()) {
            return result;
        }
        if (!options.record.empty()) {
            forget(options.record, before);
        }
        fmt::print(stderr, "palpate: the session starts again\n");
        info.started = base::utc();
    }
}

}  // namespace palpate::apps
