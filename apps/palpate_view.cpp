#include <apps/command.h>
#include <render/viewer.h>

#include <CLI/CLI.hpp>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>

namespace {

void readSize(const std::string& text, palpate::render::ViewerOptions& options)
{
    int end = 0;
    const int read = std::sscanf(text.c_str(), "%dx%d%n", &options.width, &options.height, &end);
    if (read != 2 || static_cast<std::size_t>(end) != text.size())
        throw std::runtime_error("--size " + text + ": must be WIDTHxHEIGHT in pixels, for example 1280x960");
}

void writeFigures(const std::string& file, const palpate::render::ViewerFigures& figures)
{
    constexpr double ms = 1e3;
    const nlohmann::json json{{"display", figures.display},
                              {"frames", figures.frames},
                              {"frames_per_second", figures.rate},
                              {"frame_ms_p50", figures.frameP50 * ms},
                              {"frame_ms_p90", figures.frameP90 * ms},
                              {"delay_ms_p50", figures.delayP50 * ms},
                              {"delay_ms_p99", figures.delayP99 * ms}};
    palpate::apps::writeJson(file, json);
}

}  // namespace

int main(int argc, char** argv)
{
    CLI::App app(
        "Shows a Palpate session that runs in another process. Mouse: left turns, middle shifts, wheel zooms; q ends.",
        "palpate-view");
    palpate::render::ViewerOptions options;
    std::string size = "1280x960", json;
    app.add_option("--session", options.session, "Name of the session (default: the only one that runs)");
    app.add_option("--offscreen", options.offscreen, "Write PNG files to this folder instead of opening a window");
    app.add_option("--size", size, "WIDTHxHEIGHT in pixels")->capture_default_str();
    app.add_option("--every", options.every, "With --offscreen: seconds of the session from one picture to the next")
        ->capture_default_str();
    app.add_option("--wait", options.wait, "Seconds without a session before giving up, and to stay when it has ended")
        ->capture_default_str();
    app.add_option("--frames", options.frames, "End after so many pictures (0: no limit)")->capture_default_str();
    app.add_option("--json", json, "Write frame times to this file (-: standard output)");
    app.failure_message([](const CLI::App*, const CLI::Error& e) {
        return std::string("palpate-view: ") + e.what() + " (palpate-view --help lists what there is)\n";
    });
    try {
        app.parse(argc, argv);
        readSize(size, options);
        const auto figures = palpate::render::runViewer(options);
        if (!json.empty())
            writeFigures(json, figures);
        return 0;
    } catch (const CLI::ParseError& e) {
        return app.exit(e) == 0 ? 0 : 2;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "palpate-view: %s\n", e.what());
        return 1;
    }
}
