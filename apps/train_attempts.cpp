#include <apps/train_attempts.h>

#include <base/utc.h>

#include <fmt/format.h>

#include <filesystem>

namespace palpate::apps {

namespace fs = std::filesystem;

session::TrainResult runToItsEnd(const haptics::SessionModel& model, haptics::SessionInfo& info,
                                 const session::TrainOptions& options)
{
    for (;;) {
        session::TrainResult result = session::Trainer(model, info, options).run();
        if (!result.restart || result.signal != 0 || !result.problem.empty()) {
            return result;
        }
        if (!options.record.empty()) {
            for (const char* part : {"", "-wal", "-shm", "-journal"}) {
                fs::remove(options.record.string() + part);
            }
        }
        fmt::print(stderr, "palpate: the session starts again\n");
        info.started = base::utc();
    }
}

}  // namespace palpate::apps
