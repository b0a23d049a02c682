#include <base/error.h>
#include <base/outputs.h>
#include <base/png.h>
#include <render/events.h>
#include <render/follower.h>
#include <render/hosts.h>
#include <render/movie.h>
#include <render/screen_image.h>

#include <vtkNew.h>
#include <vtkPNGWriter.h>
#include <vtkRenderWindow.h>
#include <vtkSmartPointer.h>
#include <vtkUnsignedCharArray.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

namespace palpate::render {
namespace {

// An event as a part of a file's name: "very_near_artery".
std::string fileWords(const Event& event, const channel::Name& structure)
{
    constexpr std::array words{"contact",         "inserted", "out",           "near",         "very_near",
                               "touching",        "fired",    "throw_stopped", "fire_refused", "mark",
                               "mark_taken_back", "fault",    "finished"};
    static_assert(words.size() == static_cast<std::size_t>(EventKind::finished) + 1);
    const bool ofStructure =
        event.kind == EventKind::near || event.kind == EventKind::veryNear || event.kind == EventKind::touching;
    std::string name = words[static_cast<std::size_t>(event.kind)] + (ofStructure ? "_" + text(structure) : "");
    std::ranges::replace_if(
        name, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; }, '_');
    return name;
}

// Writes under another name first, so that whoever watches the folder never reads half a picture. The folder is made with
// the first picture: a viewer that finds no session leaves nothing behind.
class PictureFiles {
public:
    PictureFiles(std::filesystem::path folder, vtkRenderWindow& window) : folder_(std::move(folder)), window_(window) {}

    void frame(double time) { write(fmt::format("frame_{:05}.png", frames_++), time); }
    void event(const std::string& name, double time) { write(fmt::format("{:03}_{}.png", events_++, name), time); }
    std::uint64_t written() const noexcept { return frames_ + events_; }

private:
    void write(const std::string& name, double time)
    {
        if (!std::exchange(made_, true))
            base::makeFolders(folder_);
        const auto grab = grabbed(window_);
        vtkNew<vtkPNGWriter> writer;
        writer->SetInputConnection(grab->GetOutputPort());
        writer->SetCompressionLevel(2);
        writer->AddText(base::pngTimeKeyword, fmt::format("{:.3f}", time).c_str());
        writer->WriteToMemoryOn();
        writer->Write();
        vtkUnsignedCharArray* const png = writer->GetResult();
        base::writeWhole(folder_ / name, {reinterpret_cast<const char*>(png->GetPointer(0)),
                                          static_cast<std::size_t>(png->GetNumberOfValues())});
    }

    std::filesystem::path folder_;
    vtkRenderWindow& window_;
    std::uint64_t frames_ = 0, events_ = 0;
    bool made_ = false;  // the folder
};

// What the pictures of a session go to.
class Outputs {
public:
    // Of a record there is nothing between two ticks.
    Outputs(const ViewerOptions& options, vtkRenderWindow& window)
        : every_(options.playback != nullptr ? std::max(options.every, 2 * early) : options.every)
    {
        if (!options.offscreen.empty())
            files_.emplace(options.offscreen, window);
        if (!options.movie.empty())
            movie_.emplace(options.movie, window);
    }

    std::uint64_t written() const noexcept { return files_ ? files_->written() : frames_; }
    /// The times [s] from `time` on.
    void begin(double time) { fileDue_ = movieDue_ = time; }
    double nextDue() const { return !movie_ ? fileDue_ : files_ ? std::min(fileDue_, movieDue_) : movieDue_; }
    void write(double time, const std::vector<std::string>& events)
    {
        if (files_ && time >= fileDue_ - early) {
            files_->frame(time);
            fileDue_ = time + every_;
        }
        for (const std::string& event : events)
            if (files_)
                files_->event(event, time);
        // A film keeps the session's time: what could not be drawn in time stands for longer.
        if (movie_ && time >= movieDue_ - early) {
            const int frames = 1 + static_cast<int>((time - movieDue_ + early) * MovieFile::rate);
            movie_->add(frames);
            movieDue_ += frames / MovieFile::rate;
            frames_ += static_cast<std::uint64_t>(frames);
        }
    }
    /// Whether there is a film.
    bool finish() { return movie_ && movie_->finish(); }

    static constexpr double early = 0.501e-3;  // [s]: half a tick, and rounding

private:
    double every_, fileDue_ = 0, movieDue_ = 0;
    std::uint64_t frames_ = 0;
    std::optional<PictureFiles> files_;
    std::optional<MovieFile> movie_;
};

// Who erases a record does not want a film of it either.
void failIfGone(const ViewerOptions& options)
{
    std::error_code failed;
    const bool gone = !options.record.empty() && !std::filesystem::exists(options.record, failed) && !failed;
    base::failIf(gone, "{}: is no longer there, it was erased or moved: {}", options.record.native(),
                 options.movie.empty() ? "the pictures end here" : "no film of it is kept");
}

// Asks whoever plays a record for the tick at `time`; whether it is there.
bool askFor(Playback& playback, double time, const Follower& follower)
{
    playback.paused = true;
    if (follower.known() && std::abs(follower.state().time - time) < Outputs::early)
        return true;
    if (std::isnan(playback.jump))
        playback.jump = time;
    return false;
}

// Follows a session that runs, or asks for one picture of a record after the other, until there is no more.
void writeAll(const ViewerOptions& options, const std::atomic<int>& stop, Picture& picture, Follower& follower,
              Outputs& outputs)
{
    constexpr double look = 1e-3 * channel::frameTicks;  // how far apart a record is searched for events [s]
    channel::State before;
    bool any = false;
    while (!stop && follower.ending() != channel::Ending::finished &&
           (options.frames == 0 || outputs.written() < options.frames)) {
        failIfGone(options);
        follower.poll(picture);
        double next = 0;
        if (options.playback != nullptr) {
            const double length = options.playback->length;
            if (length < (any ? before.time + Outputs::early : 0.0))
                return;
            next = any ? std::min({outputs.nextDue(), before.time + look, length}) : std::min(options.from, length);
        }
        const bool there = options.playback == nullptr || askFor(*options.playback, next, follower);
        if (!follower.known() || !there || (any && follower.state().tick == before.tick)) {
            std::this_thread::sleep_for(std::chrono::milliseconds(options.playback != nullptr ? 1 : 4));
            continue;
        }
        const channel::State now = follower.state();
        if (!any || now.tick < before.tick) {
            // What was before the viewer came, or in the session before, is no event.
            before = now;
            before.status = channel::Status::running;
            outputs.begin(now.time);
        }
        const auto& names = follower.structures();
        std::vector<std::string> events;
        for (const Event& event : eventsBetween(before, now))
            events.push_back(fileWords(event, names[std::min<std::size_t>(event.structure, names.size() - 1)]));
        if (now.time >= outputs.nextDue() - Outputs::early || !events.empty()) {
            const bool inTime = options.playback == nullptr && (options.every <= 0 || !options.movie.empty());
            follower.draw(picture, inTime ? Quality::moving : Quality::still);
            outputs.write(now.time, events);
        } else if (options.playback == nullptr) {
            std::this_thread::sleep_for(std::chrono::milliseconds(4));
        }
        before = now;
        any = true;
    }
}

// Whether there is a film. The record is looked for again once it has its name: what is erased after that finds it.
bool finishFilm(const ViewerOptions& options, Outputs& outputs)
{
    failIfGone(options);
    const bool filmed = outputs.finish();
    try {
        failIfGone(options);
    } catch (const std::runtime_error&) {
        std::error_code ignored;
        std::filesystem::remove(filmed ? options.movie : "", ignored);
        throw;
    }
    return filmed;
}

}  // namespace

ViewerFigures writePictures(const ViewerOptions& options, const std::atomic<int>& stop)
{
    base::checkOutputFolder(options.offscreen);
    base::checkOutput(options.movie);
    vtkNew<vtkRenderWindow> window;
    window->SetShowWindow(false);
    window->SetOffScreenRendering(1);
    window->SetMultiSamples(0);
    window->SetSize(options.width, options.height);
    Outputs outputs(options, *window);
    Picture picture(*window);
    setUp(picture, options);
    Follower follower(options.session, options.wait, options.result);
    writeAll(options, stop, picture, follower, outputs);
    const bool filmed = finishFilm(options, outputs);
    ViewerFigures figures = follower.figures();
    figures.filmed = filmed;
    figures.display = figures.frames > 0 ? picture.display() : "";
    addScans(picture.ultrasound(), figures);
    picture.close();
    return figures;
}

}  // namespace palpate::render
