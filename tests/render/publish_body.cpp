// Publishes the made-up body: publish_body SESSION play [FILE] | hold SECONDS_OF_THE_STORY [VOXELS] | wave VOXELS. It is
// not shipped. The story is told twice as fast, and begins when FILE is there: a viewer may take longer to start than it
// lasts.
#include <channel/channel.h>
#include <tests/render/body.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <string>
#include <thread>

namespace {

using namespace palpate;

constexpr int coarse = 52;

void publish(const std::string& session, const std::string& mode, const std::string& word, int heldVoxels)
{
    const double argument = mode == "play" ? 0 : std::atof(word.c_str());
    const bool wave = mode == "wave";
    const int voxels = wave ? static_cast<int>(argument) : heldVoxels;
    const double pace = mode == "play" ? 2e-3 : 1e-3;  // [s of the story], a tick
    const channel::Scenery scenery = render::bodyScenery(voxels, 0.104 / voxels);
    channel::Publisher publisher(session, scenery, render::bodyLabels(scenery));
    if (mode == "play" && !word.empty()) {
        publisher.setState(render::storyState(scenery, 0));
        while (!std::filesystem::exists(word))
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    const auto start = std::chrono::steady_clock::now();
    for (std::uint64_t tick = 1;; ++tick) {
        const double t = pace * static_cast<double>(tick);
        channel::State state = render::storyState(scenery, mode == "hold" ? argument : wave ? 1.5 : t);
        state.tick = tick;
        if (tick % 16 == 1) {
            if (wave)
                render::waveDisplaced(scenery, t, 1.5e-3, publisher.backBuffer());
            else
                render::storyDisplaced(scenery, mode == "hold" ? argument : t, publisher.backBuffer());
            publisher.backBuffer().tick = tick;
            publisher.publishDisplaced();
        }
        if (mode == "hold")
            state.time = t;
        publisher.setState(state);
        std::this_thread::sleep_until(start + std::chrono::milliseconds(tick));
        if (mode == "play" && t > render::storySeconds + 0.2)
            return;
    }
}

}  // namespace

int main(int argc, char** argv)
{
    if (argc < 3)
        return 2;
    try {
        publish(argv[1], argv[2], argc > 3 ? argv[3] : "", argc > 4 ? std::atoi(argv[4]) : coarse);
        return 0;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "publish_body: %s\n", e.what());
        return 1;
    }
}
