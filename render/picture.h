#pragma once

#include <render/canvas.h>
#include <render/channel/channel.h>
#include <render/deformation.h>
#include <render/overlay.h>
#include <render/slice_picture.h>
#include <render/tool_picture.h>
#include <render/view_frame.h>
#include <render/volume_picture.h>

#include <vtkNew.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>

#include <chrono>
#include <memory>
#include <optional>
#include <string>

namespace palpate::render {

/// The whole picture in one render window: 3-D view, slice, figures.
class Picture {
public:
    explicit Picture(vtkRenderWindow& window);
    Picture(const Picture&) = delete;
    Picture& operator=(const Picture&) = delete;
    ~Picture();

    /// Takes a session's scenery on; the camera starts anew.
    void open(const channel::Scenery& scenery, std::span<const std::uint8_t> labels, const std::string& session);
    void close();
    /// Shows what has come. `displaced` is null when there is nothing newer.
    void update(const channel::State& state, const channel::Displaced* displaced, const Health& health);
    /// Words across the picture until the next setNotice(); empty = none.
    void setNotice(const std::string& words, const std::string& smaller);
    /// `moving`: coarser where the renderer is software.
    void render(Quality quality);
    /// The renderer's name, as the driver tells it.
    std::string display();

private:
    struct Session;
    void aimCamera();

    vtkRenderWindow& window_;
    vtkNew<vtkRenderer> view_, flat_;
    SlicePicture slice_;  // before the canvas: flat things are drawn in the order in which they were added
    Canvas canvas_;
    std::unique_ptr<Session> session_;
    std::string words_, smaller_;
    std::optional<bool> software_;
};

}  // namespace palpate::render
