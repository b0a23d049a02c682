#pragma once

#include <channel/channel.h>
#include <render/canvas.h>
#include <render/concealment.h>
#include <render/ct_picture.h>
#include <render/deformation.h>
#include <render/ghost.h>
#include <render/header.h>
#include <render/overlay.h>
#include <render/palette.h>
#include <render/recorded.h>
#include <render/screen_plan.h>
#include <render/slice_picture.h>
#include <render/tool_picture.h>
#include <render/traces.h>
#include <render/ultrasound_picture.h>
#include <render/volume_picture.h>

#include <vtkNew.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace palpate::render {

/// The whole picture in one render window: 3-D view, slices, figures.
class Picture {
public:
    explicit Picture(vtkRenderWindow& window);
    ~Picture();

    /// Takes a session's scenery on; the camera starts anew.
    void open(const channel::Scenery& scenery, std::span<const std::uint8_t> labels, const std::string& session,
              std::span<const std::uint16_t> image = {}, std::span<const std::uint8_t> fine = {});
    void close();
    /// From the next session on: colours of tissues.
    void setPalette(Palette palette) noexcept { palette_ = palette; }
    /// Another session's tool beside this one's, at the same time of it; see GhostPose.
    void setGhost(Ghost ghost) { ghost_ = std::move(ghost); }
    /// The session is a record: what is known of it beyond the states that are shown. Must outlive this; null: it is none.
    void setRecorded(const Recorded* recorded) noexcept { recorded_ = recorded; }
    /// From the next session on: what is not shown.
    void conceal(Concealment what) { concealed_ = std::move(what); }
    /// Shows what has come. `displaced` is null when there is nothing newer.
    void update(const channel::State& state, const channel::Displaced* displaced, const Health& health);
    /// Takes a state down for traces and events, also between pictures.
    void note(const channel::State& state);
    /// The heading; empty: the scene's name.
    void setTitle(const std::string& title) { title_ = title; }
    /// Words across the picture until the next setNotice(); empty = none.
    void setNotice(const std::string& words, const std::string& smaller);
    /// What a session came to, instead of the notice, until the next open().
    void setResult(ResultCard result) { result_ = std::move(result); }
    /// For the steps in words: whether the hand is this window. `told`: steps are shown.
    void setSteps(bool told, bool handIsHere);
    /// Steps that are told instead of those of the session; nothing: those.
    void setCoaching(std::optional<Coaching> words) { told_ = std::move(words); }
    /// Whether a click there ends the session: on the words of the last step.
    bool endsAt(Point2 pixel) const noexcept;
    /// How much of the record is over where the bar of time has this pixel, in [0, 1].
    double timeAt(Point2 pixel) const noexcept;
    /// `moving`: coarser where the renderer is software, so that the picture is finished in time.
    void render(Quality quality);
    /// Waits until the picture is drawn, and reckons with the time since `began`, when the work on it did begin, for the
    /// next.
    void finish(std::chrono::steady_clock::time_point began);

    void show(Layout layout);
    Layout layout() const noexcept { return layout_; }
    /// Chooses the next (1) or previous (-1) tissue of the legend; the legend marks it.
    void selectTissue(int step);
    /// Multiplies the chosen tissue's opacity.
    void changeOpacity(double factor);
    /// Cuts the body open towards the needle (the default), or shows it whole.
    void setCut(bool open) noexcept { cut_ = open; }
    bool cut() const noexcept { return cut_; }
    /// How slices show a body that came with an image; tinted at first.
    void show(SliceLook look) noexcept { look_ = look; }
    SliceLook sliceLook() const noexcept { return look_; }
    bool hasImage() const noexcept;
    /// Shows the image through the session's next window.
    void nextWindow() noexcept;
    /// Shows the ultrasound picture in the place of the body, and the body in that of the slice; in layout instructor in
    /// the place of the third slice. The scanner begins with the first time. Of a scene that is guided by CT there is none:
    /// there a look costs a dose.
    void showUltrasound(bool shown);
    bool ultrasoundShown() const noexcept { return ultrasoundShown_; }
    UltrasoundPicture& ultrasound() noexcept { return ultrasound_; }
    const UltrasoundPicture& ultrasound() const noexcept { return ultrasound_; }
    /// Whether the scene is guided by CT. The last scan is shown where others have the ultrasound picture.
    bool hasCt() const noexcept { return ct_.opened(); }
    /// Whether only the body's outside is shown: to the trainee of such a scene, to whom a look inside costs a scan.
    /// Records and the instructor's layout show all.
    bool isClosed() const noexcept { return hasCt() && layout_ == Layout::trainee && recorded_ == nullptr; }
    void nextCtWindow() noexcept { ct_.nextWindow(); }
    /// Camera and opacities as they were when the session was opened.
    void resetView();
    /// Lists the keys across the picture; empty = hidden.
    void setHelp(std::vector<KeyHelp> keys) { help_ = std::move(keys); }
    /// Where the hand is that holds the tool [m]; nothing: not shown.
    void setHand(std::optional<glm::dvec3> hand) noexcept { hand_ = hand; }
    /// A few words on top, such as "PAUSED" or "REPLAY x 0.5"; empty = none.
    void setCaption(const std::string& words) { caption_ = words; }
    /// A bar that shows which fraction of a record is over, in [0, 1]; negative = none.
    void setTimeline(double fraction) { timeline_ = fraction; }
    /// Pixels per point of the screen, from 1: texts are drawn so many times larger at least.
    void setDisplayScale(double scale) { scale_ = std::max(scale, 1.0); }
    /// The point [m] under a pixel (from the lower left) of the 3-D view, in the plane through `point` [m] that faces the
    /// camera.
    glm::dvec3 under(Point2 pixel, glm::dvec3 point) const;

    /// Whether the 3-D view has `point` [m] in it, hidden by the body or not.
    bool shows(glm::dvec3 point) const;

    /// The words of the picture, and where they are.
    std::vector<Written> written() const { return canvas_.written(); }
    /// The renderer's name, as the driver tells it.
    std::string display();

private:
    struct Session;
    void aimCamera();
    ScreenPlan screenPlan() const;
    void openBody();
    void drawSlices(const ScreenPlan& plan, int step);
    void awaitSlices();
    void drawTraces(const ScreenPlan& plan);
    void drawFlat(const ScreenPlan& plan);
    Header header() const;

    vtkRenderWindow& window_;
    vtkNew<vtkRenderer> view_, flat_;
    // Before the canvas: flat things are drawn in the order in which they were added.
    std::array<SlicePicture, 3> slices_;
    UltrasoundPicture ultrasound_;
    CtPicture ct_;
    Canvas canvas_;
    std::unique_ptr<Session> session_;
    std::future<void> painting_;  // of the slices, while the body is drawn
    std::string title_, words_, smaller_, caption_;
    Palette palette_ = Palette::standard;
    Ghost ghost_;
    const Recorded* recorded_ = nullptr;
    Concealment concealed_;
    std::optional<ResultCard> result_;
    CoachView coached_;
    std::optional<Coaching> told_;
    bool stepsTold_ = false, lastStep_ = false;
    Area step_;  // where the words of the step are
    Area bar_;   // where that of a record is
    std::vector<KeyHelp> help_;
    Layout layout_ = Layout::trainee;
    SliceLook look_ = SliceLook::tinted;
    bool cut_ = true, ultrasoundShown_ = false;
    double timeline_ = -1, scale_ = 1;
    std::optional<glm::dvec3> hand_;
    std::optional<bool> software_;
};

}  // namespace palpate::render
