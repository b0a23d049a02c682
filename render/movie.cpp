#include <render/movie.h>

#include <base/error.h>
#include <base/process.h>
#include <render/screen_image.h>

#include <vtkImageData.h>

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>
#include <csignal>

#include <array>
#include <cerrno>
#include <cstring>
#include <string>
#include <system_error>
#include <utility>

namespace palpate::render {

MovieFile::MovieFile(std::filesystem::path file, vtkRenderWindow& window)
    : file_(std::move(file)), partial_(file_.string() + ".part"), window_(window)
{
    std::array<int, 2> ends{};
    const bool none = ::pipe2(ends.data(), O_CLOEXEC) != 0;
    base::failIf(none, "{}: {}", file_.native(), std::strerror(errno));
    base::Descriptor from(ends[0]);
    pipe_ = base::Descriptor(ends[1]);
    // An ffmpeg that has ended is an error of write(), and no signal.
    std::signal(SIGPIPE, SIG_IGN);
    const int* size = window.GetSize();
    const std::string extent = std::to_string(size[0]) + "x" + std::to_string(size[1]);
    const std::string output = "file:" + partial_.string();  // what stands before a colon is no protocol
    // OpenGL counts rows from below; the codec wants even sides.
    base::Program ffmpeg{{"ffmpeg",   "-loglevel", "error",    "-y",
                          "-f",       "rawvideo",  "-pix_fmt", "rgb24",
                          "-s",       extent,      "-r",       std::to_string(static_cast<int>(rate)),
                          "-i",       "-",         "-vf",      "vflip,pad=ceil(iw/2)*2:ceil(ih/2)*2",
                          "-c:v",     "libx264",   "-preset",  "veryfast",
                          "-pix_fmt", "yuv420p",   "-f",       "mp4",
                          output}};
    ffmpeg.streams[0] = ends[0];
    ffmpeg.ownGroup = true;  // Ctrl-C ends this program, which then finishes the film
    const auto [pid, error] = base::start(ffmpeg);
    ffmpeg_ = pid;
    from = base::Descriptor();
    if (error != 0) {
        closeAndWait();
        throw base::error(
            "{}: needs the program ffmpeg ({}): install the package ffmpeg, or write pictures with --offscreen DIR",
            file_.native(), std::strerror(error));
    }
}

int MovieFile::closeAndWait() noexcept
{
    pipe_ = base::Descriptor();
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
    const auto grab = grabbed(window_);
    grab->Update();
    vtkImageData& image = *grab->GetOutput();
    const auto* bytes = static_cast<const char*>(image.GetScalarPointer());
    const auto size = static_cast<std::size_t>(image.GetNumberOfPoints()) * 3;
    any_ = any_ || frames > 0;
    for (int i = 0; i < frames; ++i)
        for (std::size_t done = 0; done < size;) {
            const ssize_t written = ::write(*pipe_, bytes + done, size - done);
            base::failIf(written < 0 && errno != EINTR, "{}: ffmpeg has ended (is the disk full? its message is above)",
                         file_.native());
            done += written > 0 ? static_cast<std::size_t>(written) : 0;
        }
}

bool MovieFile::finish()
{
    const int status = closeAndWait();
    if (!any_)
        return false;
    std::error_code error;
    if (status == 0)
        std::filesystem::rename(partial_, file_, error);
    base::failIf(status != 0 || error, "{}: cannot be written (ffmpeg's message is above)", file_.native());
    return true;
}

}  // namespace palpate::render
