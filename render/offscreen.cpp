#include <render/follower.h>
#include <render/hosts.h>

#include <vtkNew.h>
#include <vtkPNGWriter.h>
#include <vtkRenderWindow.h>
#include <vtkSmartPointer.h>
#include <vtkWindowToImageFilter.h>

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <unistd.h>

namespace palpate::render {
namespace {

// A structure's name as a part of a file's name.
std::string fileWord(const channel::Name& name)
{
    std::string word(name.data(), std::find(name.begin(), name.end(), '\0'));
    for (char& c : word)
        if (std::isalnum(static_cast<unsigned char>(c)) == 0)
            c = '_';
    return word;
}

// What has happened from one state to the next, as words for files.
std::vector<std::string> eventsBetween(const channel::State& before, const channel::State& now,
                                       const channel::Name& warnedName)
{
    std::vector<std::string> events;
    if (now.phase != before.phase && now.phase != channel::Phase::free)
        events.emplace_back(now.phase == channel::Phase::contact ? "contact" : "inserted");
    if (now.warning != before.warning && now.warning != channel::Warning::none)
        events.push_back(std::string(now.warning == channel::Warning::near       ? "warning_"
                                     : now.warning == channel::Warning::veryNear ? "very_near_"
                                                                                 : "touching_") +
                         fileWord(warnedName));
    if (now.cores > before.cores)
        events.emplace_back("fired");
    if (now.status != before.status && now.status != channel::Status::running)
        events.emplace_back(now.status == channel::Status::faulted ? "fault" : "finished");
    return events;
}

// Writes under another name first, so that whoever watches the folder never reads half a picture.
class PictureFiles {
public:
    PictureFiles(std::filesystem::path folder, vtkRenderWindow& window) : folder_(std::move(folder)), window_(window) {}

    void frame() { write(fmt::format("frame_{:05}.png", frames_++)); }
    void event(const std::string& name) { write(fmt::format("{:03}_{}.png", events_++, name)); }
    std::uint64_t written() const noexcept { return frames_ + events_; }

private:
    void write(const std::string& name)
    {
        const std::filesystem::path file = folder_ / name, partial = folder_ / (name + ".part");
        vtkNew<vtkWindowToImageFilter> grab;
        grab->SetInput(&window_);
        grab->SetInputBufferTypeToRGB();
        grab->ReadFrontBufferOff();
        grab->ShouldRerenderOff();
        vtkNew<vtkPNGWriter> writer;
        writer->SetInputConnection(grab->GetOutputPort());
        writer->SetCompressionLevel(2);
        writer->SetFileName(partial.c_str());
        writer->Write();
        std::error_code error;
        if (writer->GetErrorCode() == 0)
            std::filesystem::rename(partial, file, error);
        if (writer->GetErrorCode() != 0 || error) {
            std::filesystem::remove(partial, error);
            throw std::runtime_error(file.string() + ": cannot be written (is the disk full?)");
        }
    }

    std::filesystem::path folder_;
    vtkRenderWindow& window_;
    std::uint64_t frames_ = 0, events_ = 0;
};

void makeFolder(const std::filesystem::path& folder)
{
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (!std::filesystem::is_directory(folder, error))
        throw std::runtime_error(folder.string() + ": cannot be made into a folder");
    if (::access(folder.c_str(), W_OK) != 0)
        throw std::runtime_error(folder.string() + ": this folder cannot be written to");
}

}  // namespace

ViewerFigures writePictures(const ViewerOptions& options, const std::atomic<bool>& stop)
{
    makeFolder(options.offscreen);
    vtkNew<vtkRenderWindow> window;
    window->SetShowWindow(false);
    window->SetOffScreenRendering(1);
    window->SetMultiSamples(0);
    window->SetSize(options.width, options.height);
    Picture picture(*window);
    Follower follower(options.session, options.wait);
    PictureFiles files(options.offscreen, *window);

    channel::State before;
    bool any = false;
    double due = 0;
    while (!stop && follower.ending() != channel::Ending::finished &&
           (options.frames == 0 || files.written() < options.frames)) {
        follower.poll(picture);
        constexpr auto pause = std::chrono::milliseconds(4);
        if (!follower.known() || (any && follower.state().tick == before.tick)) {
            std::this_thread::sleep_for(pause);
            continue;
        }
        const channel::State now = follower.state();
        if (!any || now.tick < before.tick) {
            // What was before the viewer came, or in the session before, is no event.
            before = now;
            before.status = channel::Status::running;
            due = now.time;
        }
        const auto& names = follower.structures();
        const auto events = eventsBetween(before, now, names[std::min<std::size_t>(now.warned, names.size() - 1)]);
        const bool time = now.time >= due;
        if (time || !events.empty())
            follower.draw(picture, options.every > 0 ? Quality::still : Quality::moving);
        if (time) {
            files.frame();
            due = now.time + options.every;
        }
        for (const std::string& event : events)
            files.event(event);
        before = now;
        any = true;
        if (!time && events.empty())
            std::this_thread::sleep_for(pause);
    }
    ViewerFigures figures = follower.figures();
    figures.display = any ? picture.display() : "";
    picture.close();
    return figures;
}

}  // namespace palpate::render
