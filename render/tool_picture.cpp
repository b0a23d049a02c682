#include <render/tool_picture.h>

#include <base/units.h>
#include <channel/needle_shape.h>

#include <vtkAppendPolyData.h>
#include <vtkCellArray.h>
#include <vtkConeSource.h>
#include <vtkCylinderSource.h>
#include <vtkLineSource.h>
#include <vtkPoints.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkSphereSource.h>
#include <vtkTransformPolyDataFilter.h>
#include <vtkTubeFilter.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

namespace palpate::render {
namespace {

using units::mm;
constexpr int facets = 24;
constexpr double pinLength = 9e-3;  // of a mark, out of the body [m]

void paint(vtkActor& actor, const std::array<double, 3>& colour)
{
    actor.GetProperty()->SetColor(colour[0], colour[1], colour[2]);
    actor.GetProperty()->SetAmbient(0.35);
    actor.GetProperty()->SetDiffuse(0.75);
    actor.GetProperty()->SetSpecular(0.3);
}

double pointLength(double radius)
{
    return 3 * radius;
}

// A needle's point with its end at the origin, pointing along +y: VTK's cylinders lie along y.
vtkSmartPointer<vtkPolyData> needlePoint(double radius)
{
    vtkNew<vtkConeSource> cone;
    cone->SetRadius(radius);
    cone->SetHeight(pointLength(radius));
    cone->SetDirection(0, 1, 0);
    cone->SetCenter(0, -pointLength(radius) / 2, 0);
    cone->SetResolution(facets);
    cone->Update();
    return cone->GetOutput();
}

vtkSmartPointer<vtkPolyData> ball(double radius, double y = 0)
{
    vtkNew<vtkSphereSource> sphere;
    sphere->SetRadius(radius);
    sphere->SetCenter(0, y, 0);
    sphere->SetThetaResolution(facets);
    sphere->SetPhiResolution(facets);
    sphere->Update();
    return sphere->GetOutput();
}

// A rod with round ends along y, the middle of its front end at the origin.
vtkSmartPointer<vtkPolyData> rodShape(double radius, double length)
{
    vtkNew<vtkCylinderSource> rod;
    rod->SetRadius(radius);
    rod->SetHeight(length);
    rod->SetCenter(0, -length / 2, 0);
    rod->SetResolution(facets);
    vtkNew<vtkAppendPolyData> all;
    all->AddInputConnection(rod->GetOutputPort());
    all->AddInputData(ball(radius));
    all->AddInputData(ball(radius, -length));
    all->Update();
    return all->GetOutput();
}

vtkSmartPointer<vtkPolyData> toolShape(const channel::Scenery& scenery)
{
    const double radius = std::max(scenery.toolRadius, 0.2e-3) * mm, length = scenery.toolLength * mm;
    switch (scenery.tool) {
        case channel::ToolKind::needle:
            return needlePoint(radius);
        case channel::ToolKind::capsule:
            return rodShape(radius, length);
        default:
            return ball(radius);
    }
}

void show(vtkRenderer& renderer, vtkActor& actor, vtkPolyData* shape, const std::array<double, 3>& colour)
{
    vtkNew<vtkPolyDataMapper> mapper;
    mapper->SetInputData(shape);
    actor.SetMapper(mapper);
    paint(actor, colour);
    renderer.AddActor(&actor);
}

// Of the line that ends at point `last`, across points that coincide.
glm::dvec3 endDirection(const channel::NeedleShape& shape, std::size_t last)
{
    constexpr double apart = 1e-4;  // [m]
    std::size_t before = last;
    while (before > 0 && glm::distance(shape[before], shape.back()) < apart)
        --before;
    return glm::normalize(shape.back() - shape[before]);
}

// One line through points that are apart.
void setLine(vtkPolyData& data, std::span<const glm::dvec3> points)
{
    constexpr double apart = 0.02;  // [mm]
    vtkNew<vtkPoints> kept;
    for (const glm::dvec3& p : points) {
        const vtkIdType last = kept->GetNumberOfPoints() - 1;
        if (last >= 0) {
            const double* q = kept->GetPoint(last);
            if (glm::distance(p * mm, glm::dvec3(q[0], q[1], q[2])) < apart)
                continue;
        }
        kept->InsertNextPoint(p.x * mm, p.y * mm, p.z * mm);
    }
    vtkNew<vtkCellArray> cells;
    if (kept->GetNumberOfPoints() > 1) {
        cells->InsertNextCell(static_cast<int>(kept->GetNumberOfPoints()));
        for (vtkIdType i = 0; i < kept->GetNumberOfPoints(); ++i)
            cells->InsertCellPoint(i);
    }
    data.SetPoints(kept);
    data.SetLines(cells);
}

// Draws a line as a tube that follows it.
void showTube(vtkRenderer& renderer, vtkPolyData& line, double radius, int sides, const std::array<double, 3>& colour)
{
    setLine(line, {});
    vtkNew<vtkTubeFilter> tube;
    tube->SetInputData(&line);
    tube->SetRadius(radius);
    tube->SetNumberOfSides(sides);
    tube->CappingOn();
    vtkNew<vtkPolyDataMapper> mapper;
    mapper->SetInputConnection(tube->GetOutputPort());
    vtkNew<vtkActor> actor;
    actor->SetMapper(mapper);
    paint(*actor, colour);
    renderer.AddActor(actor);
}

}  // namespace

// A fingertip's pose is that of the middle of its round end.
glm::dvec3 markedPlace(const channel::Scenery& scenery, const channel::Mark& mark)
{
    const double front = scenery.tool == channel::ToolKind::needle ? 0 : scenery.toolRadius;
    return glm::dvec3(mark.place[0], mark.place[1], mark.place[2]) +
           front * glm::dvec3(mark.axis[0], mark.axis[1], mark.axis[2]);
}

ToolPicture::ToolPicture(const channel::Scenery& scenery, vtkRenderer& renderer)
    : turns_(scenery.tool != channel::ToolKind::sphere)
{
    const double radius = std::max(scenery.toolRadius, 0.2e-3) * mm;
    vtkNew<vtkActor> tool;
    show(renderer, *tool, toolShape(scenery), toolColour);
    tool->SetUserTransform(pose_);
    show(renderer, *proxy_, ball(std::max(0.8 * radius, 0.8)), proxyColour);
    if (scenery.tool == channel::ToolKind::needle) {
        showTube(renderer, *shaft_, radius, facets, toolColour);
        for (auto& core : cores_)
            showTube(renderer, *core, 1.3 * radius, facets, coreColour);
        showTube(renderer, *thrown_, 0.7 * radius, facets, toolColour);
    }
    for (std::size_t i = 0; i < marks_.size(); ++i) {
        showTube(renderer, *pins_[i], 0.4, 8, markColour);
        show(renderer, *marks_[i], ball(1.5), markColour);
        marks_[i]->SetVisibility(0);
    }
    constexpr double trail = 0.3;  // [mm]
    showTube(renderer, *trail_, trail, 6, trailColour);
    showTube(renderer, *ghost_, 0.8 * radius, 8, ghostColour);
    showTube(renderer, *ghostWay_, trail, 6, ghostColour);
    showTube(renderer, *lead_, trail, 6, handColour);
    show(renderer, *hand_, ball(1.0), handColour);
    hand_->SetVisibility(0);
    addPlan(scenery, renderer);
}

void ToolPicture::addPlan(const channel::Scenery& scenery, vtkRenderer& renderer)
{
    glm::dvec3 entry = vec(scenery.entry) * mm;
    const glm::dvec3 aim = vec(scenery.aim) * mm;
    if (glm::distance(entry, aim) < 1e-3)
        return;
    // A closed body (Picture::isClosed()) hides all of the line: it begins in the air, and a ball stands where it goes in.
    if (scenery.ctSlices > 0) {
        constexpr double outside = 20.0;  // [mm]
        vtkNew<vtkActor> mark;
        show(renderer, *mark, ball(1.3), planColour);
        mark->SetPosition(entry.x, entry.y, entry.z);
        entry -= outside * glm::normalize(aim - entry);
    }
    vtkNew<vtkAppendPolyData> dashes;
    constexpr int count = 12;
    for (int i = 0; i < count; ++i) {
        const glm::dvec3 a = entry + (aim - entry) * (static_cast<double>(i) / count);
        const glm::dvec3 b = a + (aim - entry) * (0.5 / count);
        vtkNew<vtkLineSource> line;
        line->SetPoint1(a.x, a.y, a.z);
        line->SetPoint2(b.x, b.y, b.z);
        dashes->AddInputConnection(line->GetOutputPort());
    }
    vtkNew<vtkTubeFilter> tube;
    tube->SetInputConnection(dashes->GetOutputPort());
    tube->SetRadius(0.35);
    tube->SetNumberOfSides(8);
    tube->Update();
    vtkNew<vtkActor> line;
    show(renderer, *line, tube->GetOutput(), planColour);
    show(renderer, *aim_, ball(1.3), planColour);
}

void ToolPicture::moveNeedle(const channel::Scenery& scenery, const channel::State& state)
{
    channel::NeedleShape shape = needleShape(scenery, state);
    // The point follows the shaft's end.
    const double point = pointLength(std::max(scenery.toolRadius, 0.2e-3));
    std::size_t last = shape.size() - 1;
    while (last > 1 && glm::distance(shape[last - 1], vec(state.tip)) < point)
        --last;
    shape[last] = vec(state.tip) - point * endDirection(shape, last);
    setLine(*shaft_, std::span(shape).first(last + 1));
}

// A viewer of a record jumps about in it.
void ToolPicture::leaveTrail(const channel::State& state, const Recorded* recorded)
{
    if (recorded == nullptr)
        way_.add(state);
    auto way = recorded != nullptr ? recorded->wayUntil(state.time) : way_.until();
    if (way == shownWay_)
        return;  // its tube is not made anew for every picture
    setLine(*trail_, way);
    shownWay_ = std::move(way);
}

// The notch takes its core at the end of the throw: from the tip to there the inner needle is out.
void ToolPicture::showCores(const channel::State& state, const Deformation& deformation)
{
    const auto place = [&](const std::array<float, 3>& p) { return deformation.seen(glm::dvec3(p[0], p[1], p[2])); };
    const auto count = std::min<std::size_t>(state.holes, channel::maxHoles);
    for (std::size_t i = 0; i < cores_.size(); ++i) {
        const std::array ends{place(state.hole[i].from), place(state.hole[i].to)};
        setLine(*cores_[i], i < count ? std::span<const glm::dvec3>(ends) : std::span<const glm::dvec3>());
    }
    constexpr double out = 0.5;  // [s]
    if (state.cores > fired_)
        firedAt_ = state.time;
    fired_ = state.cores;
    if (state.cores == 0 || state.time < firedAt_ || state.time > firedAt_ + out)
        firedAt_ = -1;
    if (firedAt_ < 0 || count == 0) {
        setLine(*thrown_, {});
        return;
    }
    const std::array inner{vec(state.tip), place(state.hole[(state.cores - 1) % channel::maxHoles].to)};
    setLine(*thrown_, inner);
}

// A pin stands where the tool was: its point stays at the place when the tissue has come back, its head is seen.
void ToolPicture::showMarks(const channel::Scenery& scenery, const channel::State& state)
{
    const auto count = std::min<std::size_t>(state.marks, channel::maxMarks);
    for (std::size_t i = 0; i < marks_.size(); ++i) {
        const auto& axis = state.mark[i].axis;
        const glm::dvec3 place = markedPlace(scenery, state.mark[i]),
                         head = place - pinLength * glm::dvec3(axis[0], axis[1], axis[2]);
        const std::array pin{place, head};
        setLine(*pins_[i], i < count ? std::span<const glm::dvec3>(pin) : std::span<const glm::dvec3>());
        marks_[i]->SetVisibility(i < count ? 1 : 0);
        marks_[i]->SetPosition(head.x * mm, head.y * mm, head.z * mm);
    }
}

void ToolPicture::showGhost(const channel::Scenery& scenery, const Ghost& ghost, double time)
{
    if (ghost.empty())
        return;
    const GhostPose& now = at(ghost, time);
    const double length = std::max(scenery.toolLength, 10e-3);
    const std::array shaft{now.tip - length * now.axis, now.tip};
    setLine(*ghost_, shaft);
    constexpr double step = 0.5e-3;  // [m]
    std::vector<glm::dvec3> way;
    for (const GhostPose& pose : ghost) {
        if (pose.time > time)
            break;
        if (pose.inserted && (way.empty() || glm::distance(way.back(), pose.tip) > step))
            way.push_back(pose.tip);
    }
    setLine(*ghostWay_, way);
}

void ToolPicture::showHand(std::optional<glm::dvec3> hand, glm::dvec3 tip)
{
    if (!hand && hand_->GetVisibility() == 0)
        return;
    hand_->SetVisibility(hand ? 1 : 0);
    const glm::dvec3 at = hand.value_or(tip);
    hand_->SetPosition(at.x * mm, at.y * mm, at.z * mm);
    const std::array line{tip, at};
    setLine(*lead_, hand ? std::span<const glm::dvec3>(line) : std::span<const glm::dvec3>());
}

void ToolPicture::update(const channel::Scenery& scenery, const channel::State& state, const Deformation& deformation,
                         const Recorded* recorded)
{
    const glm::dvec3 aim = deformation.seen(vec(scenery.aim));
    showCores(state, deformation);
    showMarks(scenery, state);
    const glm::dvec3 tip = vec(state.tip) * mm, proxy = vec(state.proxy) * mm;
    aim_->SetPosition(aim.x * mm, aim.y * mm, aim.z * mm);
    leaveTrail(state, recorded);
    glm::dvec3 axis = vec(state.axis);
    if (scenery.tool == channel::ToolKind::needle) {
        moveNeedle(scenery, state);
        const channel::NeedleShape shape = needleShape(scenery, state);
        axis = endDirection(shape, shape.size() - 1);
    }
    const double length = glm::length(axis);
    axis = length > 0 && std::isfinite(length) ? axis / length : glm::dvec3(0, 1, 0);
    pose_->Identity();
    pose_->Translate(tip.x, tip.y, tip.z);
    if (turns_) {
        // The turn that takes +y to the axis.
        const glm::dvec3 turn = glm::cross(glm::dvec3(0, 1, 0), axis);
        const double degrees = std::atan2(glm::length(turn), axis.y) * 180.0 / std::acos(-1.0);
        if (glm::length(turn) > 1e-12)
            pose_->RotateWXYZ(degrees, turn.x, turn.y, turn.z);
        else if (axis.y < 0)
            pose_->RotateX(180);
    }
    constexpr double seen = 0.5;  // [mm]
    proxy_->SetVisibility(state.phase == channel::Phase::contact && glm::distance(tip, proxy) > seen);
    proxy_->SetPosition(proxy.x, proxy.y, proxy.z);
}

}  // namespace palpate::render
