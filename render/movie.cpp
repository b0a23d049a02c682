#include <render/movie.h>

#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkWindowToImageFilter.h>

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>
#include <csignal>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

extern char** environ;

namespace palpate::render {
namespace {

// `input` becomes ffmpeg's standard input. A group of its own: Ctrl-C ends this program, which then finishes the film.
// Returns what posix_spawnp() returns.
int startFfmpeg(std::vector<std::string> words, int input, pid_t& id)
{
    std::vector<char*> argv;
    for (std::string& word : words)
        argv.push_back(word.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t files;
    ::posix_spawn_file_actions_init(&files);
    ::posix_spawn_file_actions_adddup2(&files, input, STDIN_FILENO);
    posix_spawnattr_t attributes;
    ::posix_spawnattr_init(&attributes);
    ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    const int error = ::posix_spawnp(&id, argv[0], &files, &attributes, argv.data(), environ);
    ::posix_spawnattr_destroy(&attributes);
    ::posix_spawn_file_actions_destroy(&files);
    return error;
}

}  // namespace

MovieFile::MovieFile(std::filesystem::path file, vtkRenderWindow& window)
    : file_(std::move(file)), partial_(file_.string() + ".part"), window_(window)
{
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0)
        throw std::runtime_error(file_.string() + ": " + std::strerror(errno));
    // An ffmpeg that has ended is an error of write(), and no signal.
    std::signal(SIGPIPE, SIG_IGN);
    const int* size = window.GetSize();
    const std::string extent = std::to_string(size[0]) + "x" + std::to_string(size[1]);
    // OpenGL counts rows from below; the codec wants even sides.
    const int error = startFfmpeg({"ffmpeg",   "-loglevel", "error",    "-y",
                                   "-f",       "rawvideo",  "-pix_fmt", "rgb24",
                                   "-s",       extent,      "-r",       std::to_string(static_cast<int>(rate)),
                                   "-i",       "-",         "-vf",      "vflip,pad=ceil(iw/2)*2:ceil(ih/2)*2",
                                   "-c:v",     "libx264",   "-preset",  "veryfast",
                                   "-pix_fmt", "yuv420p",   "-f",       "mp4",
                                   partial_},
                                  ends[0], ffmpeg_);
    ::close(ends[0]);
    pipe_ = ends[1];
    if (error != 0) {
        ffmpeg_ = -1;
        closeAndWait();
        throw std::runtime_error(file_.string() + ": needs the program ffmpeg (" + std::strerror(error) +
                                 "): install the package ffmpeg, or write pictures with --offscreen DIR");
    }
}

int MovieFile::closeAndWait() noexcept
{
    if (pipe_ >= 0)
        ::close(std::exchange(pipe_, -1));
    int status = 0;
    if (ffmpeg_ > 0)
        ::waitpid(std::exchange(ffmpeg_, -1), &status, 0);
    return status;
}

MovieFile::~MovieFile()
{
    closeAndWait();
    std::error_code ignored;
    std::filesystem::remove(partial_, ignored);
}

void MovieFile::add(int frames)
{
    vtkNew<vtkWindowToImageFilter> grab;
    grab->SetInput(&window_);
    grab->SetInputBufferTypeToRGB();
    grab->ReadFrontBufferOff();
    grab->ShouldRerenderOff();
    grab->Update();
    vtkImageData& image = *grab->GetOutput();
    const auto* bytes = static_cast<const char*>(image.GetScalarPointer());
    const auto size = static_cast<std::size_t>(image.GetNumberOfPoints()) * 3;
    for (int i = 0; i < frames; ++i)
        for (std::size_t done = 0; done < size;) {
            const ssize_t written = ::write(pipe_, bytes + done, size - done);
            if (written < 0 && errno != EINTR)
                throw std::runtime_error(file_.string() + ": ffmpeg has ended (is the disk full? its message is above)");
            done += written > 0 ? static_cast<std::size_t>(written) : 0;
        }
}

void MovieFile::finish()
{
    const int status = closeAndWait();
    std::error_code error;
    if (status == 0)
        std::filesystem::rename(partial_, file_, error);
    if (status != 0 || error)
        throw std::runtime_error(file_.string() + ": cannot be written (ffmpeg's message is above)");
}

}  // namespace palpate::render
