#include <render/tool_picture.h>

#include <render/deformation.h>

#include <vtkAppendPolyData.h>
#include <vtkConeSource.h>
#include <vtkCylinderSource.h>
#include <vtkLineSource.h>
#include <vtkPolyDataMapper.h>
#include <vtkProperty.h>
#include <vtkSphereSource.h>
#include <vtkTransformPolyDataFilter.h>
#include <vtkTubeFilter.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::render {
namespace {

constexpr double mm = 1e3;
constexpr int facets = 24;

void paint(vtkActor& actor, const std::array<double, 3>& colour)
{
    actor.GetProperty()->SetColor(colour[0], colour[1], colour[2]);
    actor.GetProperty()->SetAmbient(0.35);
    actor.GetProperty()->SetDiffuse(0.75);
    actor.GetProperty()->SetSpecular(0.3);
}

// A needle with its tip at the origin, pointing along +y: VTK's cylinders lie along y.
vtkSmartPointer<vtkPolyData> needleShape(double radius, double length)
{
    const double tip = std::min(3 * radius, length / 2);
    vtkNew<vtkCylinderSource> shaft;
    shaft->SetRadius(radius);
    shaft->SetHeight(length - tip);
    shaft->SetCenter(0, -(length + tip) / 2, 0);
    shaft->SetResolution(facets);
    vtkNew<vtkConeSource> cone;
    cone->SetRadius(radius);
    cone->SetHeight(tip);
    cone->SetDirection(0, 1, 0);
    cone->SetCenter(0, -tip / 2, 0);
    cone->SetResolution(facets);
    vtkNew<vtkAppendPolyData> both;
    both->AddInputConnection(shaft->GetOutputPort());
    both->AddInputConnection(cone->GetOutputPort());
    both->Update();
    return both->GetOutput();
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
            return needleShape(radius, std::max(length, 4 * radius));
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

}  // namespace

ToolPicture::ToolPicture(const channel::Scenery& scenery, vtkRenderer& renderer)
    : turns_(scenery.tool != channel::ToolKind::sphere)
{
    const double radius = std::max(scenery.toolRadius, 0.2e-3) * mm;
    vtkNew<vtkActor> tool;
    show(renderer, *tool, toolShape(scenery), toolColour);
    tool->SetUserTransform(pose_);
    show(renderer, *proxy_, ball(std::max(0.8 * radius, 0.8)), proxyColour);
    addPlan(scenery, renderer);
}

void ToolPicture::addPlan(const channel::Scenery& scenery, vtkRenderer& renderer)
{
    const glm::dvec3 entry = vec(scenery.entry) * mm, aim = vec(scenery.aim) * mm;
    if (glm::distance(entry, aim) < 1e-3)
        return;
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
    vtkNew<vtkActor> target;
    show(renderer, *target, ball(1.3), planColour);
    target->SetPosition(aim.x, aim.y, aim.z);
}

void ToolPicture::update(const channel::State& state)
{
    const glm::dvec3 tip = vec(state.tip) * mm, proxy = vec(state.proxy) * mm;
    glm::dvec3 axis = vec(state.axis);
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
