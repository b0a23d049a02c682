#pragma once

#include <base/descriptor.h>

#include <vtkRenderWindow.h>

#include <sys/types.h>

#include <filesystem>

namespace palpate::render {

/// A film of a window (MP4, H.264), written by ffmpeg as a process of its own. It appears whole or not at all.
class MovieFile {
public:
    static constexpr double rate = 30;  // [1/s]

    /// Throws std::runtime_error where ffmpeg is not installed. The window's size must not change.
    MovieFile(std::filesystem::path file, vtkRenderWindow& window);
    MovieFile& operator=(MovieFile&&) = delete;
    ~MovieFile();

    /// The window as it is drawn, for so many frames. Throws std::runtime_error when ffmpeg has ended.
    void add(int frames);
    /// Waits for ffmpeg, and shows the file under its name. Returns whether there is a film: of no frames there is none,
    /// and no file. Throws std::runtime_error when ffmpeg failed.
    bool finish();

private:
    int closeAndWait() noexcept;

    std::filesystem::path file_, partial_;
    vtkRenderWindow& window_;
    bool any_ = false;  // frames were added
    base::Descriptor pipe_;
    pid_t ffmpeg_ = -1;
};

}  // namespace palpate::render
