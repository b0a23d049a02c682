// Reads a record: where the force was largest, and what the tissue and the guidance had in it.
//
//   record RECORD.db
#include <palpate/haptics/recorder.h>

#include <glm/geometric.hpp>

#include <cstdio>
#include <exception>

using namespace palpate;

int main(int argc, char** argv)
{
    if (argc != 2) {
        std::fprintf(stderr, "usage: record RECORD.db\n");
        return 2;
    }
    try {
        const haptics::Record record(argv[1]);
        haptics::TickRecord peak;
        record.each([&](const haptics::TickRecord& tick) {
            if (glm::length(tick.total) > glm::length(peak.total)) {
                peak = tick;
            }
        });
        const haptics::SessionInfo& info = record.info();
        std::printf("%s by %s, %s: %llu ticks%s\n", info.scene.c_str(), info.device.c_str(), info.build.c_str(),
                    static_cast<unsigned long long>(record.ticks()), record.complete() ? "" : ", interrupted");
        std::printf("largest force %.3f N after %.3f s, %.1f mm inside: tissue %.3f N, guidance %.3f N\n",
                    glm::length(peak.total), static_cast<double>(peak.tick) / info.rate, 1e3 * peak.inserted,
                    glm::length(peak.tissueForce), glm::length(peak.additional));
        return 0;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "record: %s\n", e.what());
        return 1;
    }
}
