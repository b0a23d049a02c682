#include <render/picture.h>

#include <vtkCamera.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

namespace palpate::render {
namespace {

constexpr double mm = 1e3;

// Box of the voxels that can be seen [m].
std::pair<glm::dvec3, glm::dvec3> bodyBox(const Deformation& deformation)
{
    const channel::Grid& grid = deformation.grid();
    const auto labels = deformation.labels();
    glm::ivec3 low(grid.size[0], grid.size[1], grid.size[2]), high(-1);
    std::size_t at = 0;
    for (int z = 0; z < grid.size[2]; ++z)
        for (int y = 0; y < grid.size[1]; ++y)
            for (int x = 0; x < grid.size[0]; ++x)
                if (labels[at++] != 0) {
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
        ++voxels[label];
    std::vector<std::uint8_t> rows;
    for (std::uint8_t row = 1; row < std::min<std::uint32_t>(scenery.tissues, channel::maxTissues); ++row)
        if (voxels[row] > 0 && scenery.tissue[row].opacity > 0)
            rows.push_back(row);
    std::sort(rows.begin(), rows.end(), [&](std::uint8_t a, std::uint8_t b) { return voxels[a] < voxels[b]; });
    return rows;
}

}  // namespace

struct Picture::Session {
    Session(const channel::Scenery& shown, std::span<const std::uint8_t> labels, std::string sessionName,
            vtkRenderer& renderer)
        : scenery(shown),
          name(std::move(sessionName)),
          frame(viewFrame(shown)),
          deformation(shown, labels),
          volume(shown, deformation, renderer),
          tool(shown, renderer),
          legend(tissuesIn(shown, labels))
    {
    }

    channel::Scenery scenery;
    std::string name;
    ViewFrame frame;
    Deformation deformation;
    VolumePicture volume;
    ToolPicture tool;
    std::vector<std::uint8_t> legend;  // rows of the tissues that there are, smallest volume first
    channel::State state;
    Health health;
    bool known = false;  // a state has come
    VoxelBox changed;    // since the last slice
};

Picture::Picture(vtkRenderWindow& window) : window_(window), slice_(*flat_), canvas_(*flat_)
{
    window_.SetNumberOfLayers(2);
    view_->SetBackground(0.06, 0.07, 0.10);
    view_->SetLayer(0);
    flat_->SetLayer(1);
    flat_->InteractiveOff();
    window_.AddRenderer(view_);
    window_.AddRenderer(flat_);
}

Picture::~Picture() = default;

void Picture::open(const channel::Scenery& scenery, std::span<const std::uint8_t> labels, const std::string& session)
{
    close();
    session_ = std::make_unique<Session>(scenery, labels, session, *view_);
    const glm::dvec3 line = vec(scenery.entry) != vec(scenery.aim) ? vec(scenery.aim) : session_->frame.centre;
    session_->volume.cut(line, session_->frame.towards);
    aimCamera();
}

void Picture::close()
{
    session_.reset();
    view_->RemoveAllViewProps();
    slice_.hide();
}

// Looks onto the plane of the slice from a little to the side and above, so that both pictures have the same directions and
// this one has depth; as near as the body's box allows.
void Picture::aimCamera()
{
    auto [low, high] = bodyBox(session_->deformation);
    const ViewFrame& frame = session_->frame;
    // Of a large body only the part around the procedure.
    constexpr double wideEnough = 0.055;  // to each side [m]
    const double around = std::max(wideEnough, 0.75 * frame.extent);
    low = glm::max(low, glm::min(frame.centre - around, high));
    high = glm::min(high, glm::max(frame.centre + around, low));
    const glm::dvec3 from = glm::normalize(frame.towards + 0.35 * frame.up + 0.30 * frame.right);
    const glm::dvec3 right = glm::normalize(glm::cross(frame.up, from)), up = glm::cross(from, right);
    const ScreenPlan plan(window_.GetSize()[0], window_.GetSize()[1]);
    constexpr double angle = 25.0;  // of the view, upright [degrees]
    constexpr double filled = 1.1;  // share of the view; a body hardly fills the corners of its box
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

void Picture::update(const channel::State& state, const channel::Displaced* displaced, const Health& health)
{
    if (!session_)
        return;
    if (displaced != nullptr) {
        const VoxelBox changed = session_->deformation.apply(*displaced);
        session_->volume.update(session_->deformation, changed);
        session_->changed = enclosing(session_->changed, changed);
    }
    session_->state = state;
    session_->health = health;
    session_->known = true;
    session_->tool.update(state);
}

void Picture::setNotice(const std::string& words, const std::string& smaller)
{
    words_ = words;
    smaller_ = smaller;
}

void Picture::render(Quality quality)
{
    const ScreenPlan plan(window_.GetSize()[0], window_.GetSize()[1]);
    view_->SetViewport(0, 0, session_ ? static_cast<double>(plan.view.width) / plan.width : 1.0, 1);
    canvas_.begin();
    if (session_) {
        Session& s = *session_;
        if (!software_) {
            const std::string name = display();
            software_ = name.find("llvmpipe") != std::string::npos || name.find("softpipe") != std::string::npos;
        }
        s.volume.setQuality(quality, *software_, static_cast<double>(plan.view.width) * plan.view.height);
        if (plan.slice.height > 0) {
            const ViewFrame frame = s.known && s.scenery.tool == channel::ToolKind::needle
                                        ? through(s.frame, vec(s.state.tip), vec(s.state.axis))
                                        : s.frame;
            slice_.update(s.scenery, s.deformation, frame, plan.slice, std::exchange(s.changed, {}));
            slice_.annotate(canvas_, s.scenery, s.state, plan.font);
        }
        drawFigures(canvas_, plan, s.scenery, s.state, s.health, s.name, s.legend);
    }
    if (!words_.empty())
        drawNotice(canvas_, plan, words_, smaller_);
    canvas_.end();
    view_->ResetCameraClippingRange();
    window_.Render();
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
