#include <render/picture.h>

#include <base/units.h>

#include <vtkCallbackCommand.h>
#include <vtkCamera.h>
#include <vtkCommand.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <cmath>

namespace palpate::render {
namespace {

using units::mm;

// Box of the voxels that can be seen [m].
std::pair<glm::dvec3, glm::dvec3> bodyBox(const Deformation& deformation)
{
    const channel::Grid& grid = deformation.grid();
    const auto labels = deformation.labels();
    glm::ivec3 low = channel::sizeOf(grid), high(-1);
    std::size_t at = 0;
    for (int z = 0; z < grid.size[2]; ++z)
        for (int y = 0; y < grid.size[1]; ++y)
            for (int x = 0; x < grid.size[0]; ++x)
                if ((labels[at++] & channel::rowBits) != 0) {
                    low = glm::min(low, glm::ivec3(x, y, z));
                    high = glm::max(high, glm::ivec3(x, y, z));
                }
    if (high.x < low.x)
        return {vec(grid.origin), vec(grid.origin) + grid.spacing};
    return {vec(grid.origin) + grid.spacing * glm::dvec3(low), vec(grid.origin) + grid.spacing * glm::dvec3(high)};
}

// What is small stands first: it is what one looks for.
std::vector<std::uint8_t> tissuesIn(const channel::Scenery& scenery, std::span<const std::uint8_t> labels)
{
    std::array<std::size_t, 256> voxels{};
    for (const std::uint8_t label : labels)
        ++voxels[label & channel::rowBits];
    std::vector<std::uint8_t> rows;
    for (std::uint8_t row = 1; row < std::min<std::uint32_t>(scenery.tissues, channel::maxTissues); ++row)
        if (voxels[row] > 0 && scenery.tissue[row].opacity > 0)
            rows.push_back(row);
    std::sort(rows.begin(), rows.end(), [&](std::uint8_t a, std::uint8_t b) { return voxels[a] < voxels[b]; });
    return rows;
}

}  // namespace

struct Picture::Session {
    Session(const channel::Scenery& shown, std::span<const std::uint8_t> labels, std::span<const std::uint16_t> image,
            std::span<const std::uint8_t> fineLabels, std::string sessionName, vtkRenderer& renderer)
        : scenery(shown),
          name(std::move(sessionName)),
          frame(viewFrame(shown)),
          deformation(shown, labels),
          grey(shown, image),
          coarse(labels.begin(), labels.end()),
          fine(fineLabels.begin(), fineLabels.end()),
          volume(shown, deformation, renderer),
          tool(shown, renderer),
          legend(tissuesIn(shown, labels))
    {
        factor.fill(1);
    }

    void repaint()
    {
        if (closed)
            volume.paintClosed(scenery, deformation);
        else
            volume.paint(scenery, deformation, factor);
    }
    void close(bool nowClosed)
    {
        if (std::exchange(closed, nowClosed) != nowClosed)
            repaint();
    }
    glm::dvec3 aim() const { return deformation.seen(vec(scenery.aim)); }

    channel::Scenery scenery;  // as it is shown
    std::string name;
    ViewFrame frame;
    glm::dvec3 entry{0.0}, line{0.0};  // of the plan, shown or not [m]
    glm::dvec3 from{0.0};              // where the camera looks from at first
    Deformation deformation;
    GreyImage grey;
    std::vector<std::uint8_t> coarse, fine;  // labels, for a scanner that begins later
    VolumePicture volume;
    ToolPicture tool;
    std::vector<std::uint8_t> legend;                 // rows of the tissues that there are, smallest volume first
    std::size_t chosen = 0;                           // of the legend, from 1; 0: none
    std::array<float, channel::maxTissues> factor{};  // of the table's opacities
    channel::State state;
    History history;
    Health health;
    bool known = false;   // a state has come
    bool closed = false;  // only the outside is painted
    channel::Displaced shape;
    VoxelBox changed;  // since the last slices
};

Picture::Picture(vtkRenderWindow& window)
    : window_(window),
      slices_{SlicePicture(*flat_), SlicePicture(*flat_), SlicePicture(*flat_)},
      ultrasound_(*flat_),
      ct_(*flat_),
      canvas_(*flat_)
{
    window_.SetNumberOfLayers(2);
    view_->SetBackground(0.06, 0.07, 0.10);
    view_->SetLayer(0);
    flat_->SetLayer(1);
    flat_->InteractiveOff();
    window_.AddRenderer(view_);
    window_.AddRenderer(flat_);
    vtkNew<vtkCallbackCommand> needed;
    needed->SetClientData(this);
    needed->SetCallback([](vtkObject*, unsigned long, void* self, void*) { static_cast<Picture*>(self)->awaitSlices(); });
    flat_->AddObserver(vtkCommand::StartEvent, needed);
}

Picture::~Picture() = default;

void Picture::open(const channel::Scenery& scenery, std::span<const std::uint8_t> labels, const std::string& session,
                   std::span<const std::uint16_t> image, std::span<const std::uint8_t> fine)
{
    checkTissues(concealed_, scenery, labels);
    close();
    result_.reset();
    channel::Scenery shown = scenery;
    std::vector<std::uint8_t> coarse(labels.begin(), labels.end()), finer(fine.begin(), fine.end());
    palpate::render::conceal(concealed_, scenery, scenery.labels, coarse);
    palpate::render::conceal(concealed_, scenery, scenery.fine, finer);
    palpate::render::conceal(concealed_, shown);
    paint(palette_, shown);
    session_ = std::make_unique<Session>(shown, coarse, image, finer, session, *view_);
    session_->frame = viewFrame(scenery);
    session_->entry = vec(scenery.entry);
    session_->line = vec(scenery.aim) - vec(scenery.entry);
    session_->from = cameraDirection(scenery, session_->frame);
    if (scenery.ctSlices > 0)
        ct_.open(shown, coarse, image);
    aimCamera();
    showUltrasound(ultrasoundShown_ || scenery.probe != channel::ProbeKind::none);
}

void Picture::close()
{
    awaitSlices();
    ultrasound_.close();
    ct_.close();
    session_.reset();
    view_->RemoveAllViewProps();
    for (SlicePicture& slice : slices_)
        slice.hide();
}

// Looks onto the plane of the slice, as near as the body's box and the tool, which waits before the entry, allow.
void Picture::aimCamera()
{
    auto [low, high] = bodyBox(session_->deformation);
    const ViewFrame& frame = session_->frame;
    // Of a large body only the part around the procedure.
    constexpr double wideEnough = 0.055;  // to each side [m]
    const double around = std::max(wideEnough, 0.75 * frame.extent);
    low = glm::max(low, glm::min(frame.centre - around, high));
    high = glm::min(high, glm::max(frame.centre + around, low));
    if (const glm::dvec3 line = session_->line; glm::length(line) > 1e-4) {
        constexpr double waiting = 48e-3;  // from the body to the shaft, with room for the words above it [m]
        const glm::dvec3 tool = session_->entry - waiting * glm::normalize(line);
        low = glm::min(low, tool);
        high = glm::max(high, tool);
    }
    const glm::dvec3 from = session_->from;
    const glm::dvec3 right = glm::normalize(glm::cross(frame.up, from)), up = glm::cross(from, right);
    const ScreenPlan plan = screenPlan();
    constexpr double angle = 25.0;  // of the view, upright [degrees]
    constexpr double filled = 1.1;  // fraction of the view; a body hardly fills the corners of its box
    const double tall = filled * std::tan(0.5 * angle / 180.0 * std::acos(-1.0));
    const double wide = tall * plan.view.width / plan.view.height;
    double distance = 0;
    for (int k = 0; k < 8; ++k) {
        const glm::dvec3 sign((k & 1) != 0 ? 0.5 : -0.5, (k & 2) != 0 ? 0.5 : -0.5, (k & 4) != 0 ? 0.5 : -0.5);
        const glm::dvec3 corner = sign * (high - low) * mm;
        distance = std::max({distance, glm::dot(corner, from) + std::abs(glm::dot(corner, right)) / wide,
                             glm::dot(corner, from) + std::abs(glm::dot(corner, up)) / tall});
    }
    const glm::dvec3 focus = 0.5 * (low + high) * mm, eye = focus + from * distance;
    vtkCamera& camera = *view_->GetActiveCamera();
    camera.SetViewAngle(angle);
    camera.SetFocalPoint(focus.x, focus.y, focus.z);
    camera.SetPosition(eye.x, eye.y, eye.z);
    camera.SetViewUp(frame.up.x, frame.up.y, frame.up.z);
}

void Picture::update(const channel::State& told, const channel::Displaced* displaced, const Health& health)
{
    if (!session_)
        return;
    channel::State state = told;
    palpate::render::conceal(concealed_, state);
    if (displaced != nullptr) {
        const VoxelBox changed = session_->deformation.apply(*displaced);
        session_->volume.update(session_->deformation);
        session_->changed = enclosing(session_->changed, changed);
    }
    if (displaced != nullptr)
        session_->shape = *displaced;
    ultrasound_.see(state, displaced);
    ct_.see(state, session_->shape, recorded_);
    session_->state = state;
    session_->health = health;
    session_->known = true;
    session_->tool.update(session_->scenery, state, session_->deformation, recorded_);
    session_->tool.showGhost(session_->scenery, ghost_, state.time);
    note(told);
}

void Picture::note(const channel::State& state)
{
    if (!session_)
        return;
    channel::State shown = state;
    palpate::render::conceal(concealed_, shown);
    session_->history.add(shown);
}

void Picture::setNotice(const std::string& words, const std::string& smaller)
{
    words_ = words;
    smaller_ = smaller;
}

ScreenPlan Picture::screenPlan() const
{
    return {window_.GetSize()[0], window_.GetSize()[1], layout_, scale_,
            ultrasoundShown_ || (hasCt() && layout_ != Layout::body)};
}

void Picture::showUltrasound(bool shown)
{
    shown = shown && !hasCt();
    const bool turned = std::exchange(ultrasoundShown_, shown) != shown;
    if (!shown)
        ultrasound_.hide();
    ct_.hide();
    if (!session_)
        return;
    if (shown && !ultrasound_.opened()) {
        ultrasound_.open(session_->scenery, session_->coarse, session_->fine, session_->name);
        if (session_->known)
            ultrasound_.see(session_->state, &session_->shape);
    }
    if (turned)
        aimCamera();
}

void Picture::render(Quality quality)
{
    const ScreenPlan plan = screenPlan();
    const double w = plan.width, h = plan.height;
    const Area all{0, 0, plan.width, plan.height}, view = session_ ? plan.view : all;
    view_->SetViewport(view.x / w, view.y / h, (view.x + view.width) / w, (view.y + view.height) / h);
    canvas_.begin();
    if (session_) {
        openBody();
        session_->tool.showHand(hand_, vec(session_->state.tip));
        session_->volume.prepare(quality, software_.value_or(true), static_cast<double>(view.width) * view.height);
        drawSlices(plan, quality == Quality::moving && software_.value_or(true) ? 2 : 1);
        const Area& around = layout_ == Layout::trainee ? plan.title : plan.ultrasound;
        if (!plan.ultrasound.empty() && hasCt() && help_.empty())
            ct_.draw(canvas_, plan.ultrasound, around, plan.font, {quality == Quality::still, coached_.handIsHere});
        else if (!plan.ultrasound.empty() && !hasCt())
            ultrasound_.draw(canvas_, plan.ultrasound, around, plan.font, quality == Quality::still, help_.empty());
        drawFlat(plan);
    }
    if (result_ && session_)
        drawResult(canvas_, plan, *result_, smaller_);
    else if (!words_.empty())
        drawNotice(canvas_, plan, words_, smaller_);
    canvas_.end();
    view_->ResetCameraClippingRange();
    window_.Render();
    if (session_ && (!session_->volume.shown() || session_->volume.renewed()))
        window_.Render();
    awaitSlices();
}

void Picture::finish(std::chrono::steady_clock::time_point began)
{
    window_.WaitForCompletion();
    if (!software_) {
        // The driver is known from the first picture on.
        const std::string name = display();
        software_ = name.find("llvmpipe") != std::string::npos || name.find("softpipe") != std::string::npos;
    }
    if (session_)
        session_->volume.took(std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count());
}

// The plane of the cut holds the needle (in the air the planned line) and turns with the camera, so that from wherever one
// looks the needle lies on the face that one sees.
void Picture::openBody()
{
    Session& s = *session_;
    s.close(isClosed());
    if (!cut_ || s.closed) {
        s.volume.uncut();
        return;
    }
    const double* eye = view_->GetActiveCamera()->GetDirectionOfProjection();
    const glm::dvec3 towards(-eye[0], -eye[1], -eye[2]);
    const bool needle = s.known && s.scenery.tool == channel::ToolKind::needle && s.state.phase != channel::Phase::free;
    const bool planned = vec(s.scenery.entry) != vec(s.scenery.aim);
    const glm::dvec3 point = needle ? vec(s.state.tip) : planned ? vec(s.scenery.aim) : s.frame.centre;
    const glm::dvec3 line = needle ? vec(s.state.axis) : vec(s.scenery.aim) - vec(s.scenery.entry);
    const double length = glm::length(line);
    glm::dvec3 normal = s.frame.towards;
    constexpr double endOn = 0.3;
    if (length > 0) {
        const glm::dvec3 across = towards - glm::dot(towards, line) / (length * length) * line;
        if (glm::length(across) > endOn)
            normal = glm::normalize(across);
    }
    s.volume.cut(point, normal);
}

void Picture::drawSlices(const ScreenPlan& plan, int step)
{
    Session& s = *session_;
    std::array<ViewFrame, 3> frames{s.frame, s.frame, s.frame};
    if (layout_ == Layout::instructor)
        frames = orthogonalFrames(s.frame, s.known ? vec(s.state.tip) : s.frame.centre);
    else if (s.known && s.scenery.tool == channel::ToolKind::needle)
        frames[0] = through(s.frame, vec(s.state.tip), vec(s.state.axis));
    const Anatomy anatomy{s.scenery, s.deformation, s.grey, look_, palette_};
    bool due = false;
    for (std::size_t i = 0; i < slices_.size(); ++i) {
        if (plan.slices[i].empty()) {
            slices_[i].hide();
            continue;
        }
        due = slices_[i].update(anatomy, frames[i], plan.slices[i], s.changed, step) || due;
        slices_[i].annotate(canvas_, anatomy, s.state, s.aim(), plan.font);
    }
    s.changed = {};
    if (due)
        painting_ = std::async(std::launch::async, [this, anatomy] {
            for (SlicePicture& slice : slices_)
                slice.paint(anatomy);
        });
}

void Picture::awaitSlices()
{
    if (painting_.valid())
        painting_.get();
}

// Below the list of keys their places are empty: what was drawn there before would stay.
void Picture::drawTraces(const ScreenPlan& plan)
{
    for (const Area& area : {plan.forces, plan.distances})
        if (!area.empty() && !help_.empty())
            canvas_.rectangle(area, panelColour);
    if (recorded_ != nullptr && !(plan.forces.empty() && plan.distances.empty())) {
        session_->history.moments = recorded_->momentsUntil(session_->state.time);
        for (History::Moment& moment : session_->history.moments)
            palpate::render::conceal(concealed_, moment);
    }
    if (!plan.forces.empty() && help_.empty())
        drawForceTraces(canvas_, plan.forces, plan.font, session_->scenery, session_->history);
    if (!plan.distances.empty() && help_.empty())
        drawDistanceTraces(canvas_, plan.distances, plan.font, session_->scenery, session_->history);
}

void Picture::drawFlat(const ScreenPlan& plan)
{
    Session& s = *session_;
    step_ = {};
    if (layout_ == Layout::body)
        return;
    drawTraces(plan);
    const bool covered = !help_.empty() && drawHelp(canvas_, plan, help_);
    if (!covered) {
        drawFigures(canvas_, plan, s.scenery, s.state, s.health, !concealed_.tissues.empty());
        drawEvents(canvas_, plan, s.scenery,
                   recorded_ != nullptr ? recorded_->eventsUntil(s.state.time) : s.history.events);
    }
    const bool apart = !plan.events.empty(), free = words_.empty() && help_.empty();
    double below = plan.height;
    if (s.known) {
        // Help leaves room for title, warning and, where it can, step, what is wrong and caption: the tool stays live.
        Header words = header();
        words.keysListed = !help_.empty();
        lastStep_ = words.coaching.last;
        const HeaderPlaces places = drawHeader(canvas_, plan, s.scenery, s.state, words);
        step_ = places.step;
        bar_ = places.timeline;
        below = places.bottom;
    }
    const bool grey = look_ != SliceLook::tissue && hasImage();
    for (const SlicePicture& slice : covered ? std::span<const SlicePicture>() : std::span<const SlicePicture>(slices_))
        slice.label(canvas_, grey ? &s.grey : nullptr, plan.font, !apart ? plan.height : free ? below : 0);
    // Where the legend has a place of its own help and notices do not cover it.
    if (!plan.legend.empty() && (apart || free) && !covered) {
        const int row = s.chosen > 0 ? s.legend[s.chosen - 1] : -1;
        const float factor = row > 0 ? s.factor[static_cast<std::size_t>(row)] : 1;
        drawLegend(canvas_, plan, s.scenery,
                   {s.legend, row, factor, palette_, !ghost_.empty(), s.state.marks > 0, apart ? plan.height : below});
    }
}

Header Picture::header() const
{
    const Session& s = *session_;
    Header header{title_.empty() ? text(s.scenery.scene) : title_, s.name, caption_, timeline_, {}};
    if (!stepsTold_ || !words_.empty())
        return header;
    if (told_) {
        header.coaching = *told_;
        return header;
    }
    CoachView view = coached_;
    view.aim = s.aim();
    view.planned = !concealed_.any();
    view.outOfSight = !shows(vec(s.state.tip));
    view.targetHidden = !concealed_.tissues.empty();
    view.scanned = ultrasoundShown_;
    header.coaching = coach(s.scenery, s.state, view);
    return header;
}

void Picture::setSteps(bool told, bool handIsHere)
{
    stepsTold_ = told;
    coached_.handIsHere = handIsHere;
}

bool Picture::endsAt(Point2 pixel) const noexcept
{
    return lastStep_ && step_.holds(pixel);
}

// A layout without the bar has the whole width for it.
double Picture::timeAt(Point2 pixel) const noexcept
{
    const bool isDrawn = layout_ != Layout::body && !bar_.empty();
    const Area bar = isDrawn ? bar_ : Area{0, 0, std::max(window_.GetSize()[0], 1), 1};
    return std::clamp((pixel[0] - bar.x) / bar.width, 0.0, 1.0);
}

void Picture::show(Layout layout)
{
    const bool turned = std::exchange(layout_, layout) != layout;
    if (turned && session_)
        aimCamera();
}

void Picture::selectTissue(int step)
{
    if (!session_)
        return;
    const auto count = static_cast<int>(session_->legend.size()) + 1;
    session_->chosen = static_cast<std::size_t>(((static_cast<int>(session_->chosen) + step) % count + count) % count);
}

void Picture::changeOpacity(double factor)
{
    if (!session_ || session_->chosen == 0)
        return;
    constexpr float least = 0.05F, most = 20.0F;
    float& now = session_->factor[session_->legend[session_->chosen - 1]];
    now = std::clamp(now * static_cast<float>(factor), least, most);
    session_->repaint();
}

bool Picture::hasImage() const noexcept
{
    return session_ != nullptr && !session_->grey.empty();
}

void Picture::nextWindow() noexcept
{
    if (session_)
        session_->grey.nextWindow();
}

void Picture::resetView()
{
    if (!session_)
        return;
    aimCamera();
    session_->chosen = 0;
    session_->factor.fill(1);
    session_->repaint();
}

std::string Picture::display()
{
    const char* report = window_.ReportCapabilities();
    const std::string all = report != nullptr ? report : "";
    const std::string key = "OpenGL renderer string:";
    const std::size_t at = all.find(key);
    if (at == std::string::npos)
        return "unknown";
    const std::size_t begin = all.find_first_not_of(' ', at + key.size()), end = all.find('\n', begin);
    return begin == std::string::npos ? "unknown" : all.substr(begin, end - begin);
}

}  // namespace palpate::render
