// Takes a core of the built-in breast phantom with a scripted hand, as fast as it goes, records it, and prints the score.
//
//   biopsy RECORD.db
#include <palpate/session/open.h>
#include <palpate/session/trainer.h>

#include <cstdio>
#include <exception>

using namespace palpate;

int main(int argc, char** argv)
{
    if (argc != 2) {
        std::fprintf(stderr, "usage: biopsy RECORD.db\n");
        return 2;
    }
    try {
        const haptics::SessionModel model = session::openSession("breast", {});
        session::TrainOptions options;
        options.session = "example-biopsy";  // under this name viewers would find it
        options.record = argv[1];
        options.servo.paced = false;  // true: one tick per millisecond, as a hand needs it
        session::Trainer trainer(model, session::describeSession(model, "breast", options.device.name), options);
        const session::TrainResult result = trainer.run();
        if (!result.problem.empty()) {
            throw std::runtime_error(result.problem);
        }
        std::printf("%.0f of 100; largest force %.2f N\n", result.score.total, result.peakTotal);
        for (const haptics::CoreSample& core : result.cores) {
            std::printf("core: %.0f %% target, %.1f mm of it\n", 100 * core.targetFraction, 1e3 * core.targetLength);
        }
        return result.cores.empty() ? 1 : 0;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "biopsy: %s\n", e.what());
        return 1;
    }
}
