#pragma once

#include <render/picture.h>
#include <render/viewer.h>

#include <atomic>

namespace palpate::render {

/// What a picture shows, and how, of what was asked for.
inline void setUp(Picture& picture, const ViewerOptions& options)
{
    picture.setTitle(options.title);
    picture.setPalette(options.palette);
    picture.setGhost(options.ghost);
    picture.setRecorded(options.playback != nullptr ? &options.playback->recorded : nullptr);
    picture.conceal(options.concealed);
    picture.show(options.layout);
    picture.show(options.slices);
    picture.showUltrasound(options.ultrasound);
}

/// Shows the session in a GLFW window until it is over, the window is closed or `stop` is not 0.
ViewerFigures showInWindow(const ViewerOptions& options, const std::atomic<int>& stop);

/// Writes the session as PNG files until it has ended or `stop` is not 0:
///
///     frame_00000.png ..      every `options.every` seconds of the session
///     000_contact.png ..      at events: contact, inserted, warning_STRUCTURE, touching_STRUCTURE, fired, fault, finished
ViewerFigures writePictures(const ViewerOptions& options, const std::atomic<int>& stop);

}  // namespace palpate::render
