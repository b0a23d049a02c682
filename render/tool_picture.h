#pragma once

#include <channel/layout.h>
#include <render/deformation.h>
#include <render/ghost.h>
#include <render/recorded.h>
#include <render/tip_way.h>

#include <vtkActor.h>
#include <vtkNew.h>
#include <vtkPolyData.h>
#include <vtkRenderer.h>
#include <vtkTransform.h>

#include <glm/vec3.hpp>

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

namespace palpate::render {

/// Colours that mean the same in the 3-D view, on the slice and in the legend.
inline constexpr std::array<double, 3> toolColour{0.25, 0.85, 1.0};
inline constexpr std::array<double, 3> planColour{1.0, 1.0, 1.0};
inline constexpr std::array<double, 3> proxyColour{1.0, 0.9, 0.2};
inline constexpr std::array<double, 3> trailColour{1.0, 0.45, 0.85};
inline constexpr std::array<double, 3> handColour{0.55, 1.0, 0.35};
inline constexpr std::array<double, 3> ghostColour{0.78, 0.60, 1.0};
inline constexpr std::array<double, 3> markColour{1.0, 0.25, 0.6};
inline constexpr std::array<double, 3> coreColour{1.0, 0.95, 0.45};

/// Where the front of the tool was when a place was marked [m].
glm::dvec3 markedPlace(const channel::Scenery& scenery, const channel::Mark& mark);

/// The tool, a needle as it is bent; the way that its tip has come since it went in; the point on the surface that it would
/// be at without penetration; the planned line and its aim; the gun's throw, for half a second after it was fired, and the
/// places of the cores; a pin at each place that was marked.
class ToolPicture {
public:
    ToolPicture(const channel::Scenery& scenery, vtkRenderer& renderer);
    /// @param recorded  of a record, what is known of it; else null, and the states come in the order of time
    void update(const channel::Scenery& scenery, const channel::State& state, const Deformation& deformation,
                const Recorded* recorded = nullptr);
    /// The tool of another session, where it was at `time` [s] of it, and the way of its tip up to there.
    void showGhost(const channel::Scenery& scenery, const Ghost& ghost, double time);
    /// Where the hand is that holds the tool [m], with a line to the `tip`; nothing: not shown.
    void showHand(std::optional<glm::dvec3> hand, glm::dvec3 tip);

private:
    void addPlan(const channel::Scenery& scenery, vtkRenderer& renderer);
    void moveNeedle(const channel::Scenery& scenery, const channel::State& state);
    void leaveTrail(const channel::State& state, const Recorded* recorded);
    void showMarks(const channel::Scenery& scenery, const channel::State& state);
    void showCores(const channel::State& state, const Deformation& deformation);

    bool turns_ = false;         // with the axis: no sphere
    vtkNew<vtkTransform> pose_;  // of the tool; of a needle, of its point
    vtkNew<vtkActor> proxy_, aim_, hand_;
    vtkNew<vtkPolyData> ghost_, ghostWay_;      // of another session: its shaft, the way of its tip [mm]
    vtkNew<vtkPolyData> shaft_, trail_, lead_;  // middle line of a needle, way of its tip, from the tip to the hand [mm]
    std::array<vtkNew<vtkPolyData>, channel::maxHoles> cores_;  // [mm]
    std::array<vtkNew<vtkPolyData>, channel::maxMarks> pins_;   // [mm]
    std::array<vtkNew<vtkActor>, channel::maxMarks> marks_;
    vtkNew<vtkPolyData> thrown_;  // the inner needle while it is out [mm]
    std::uint32_t fired_ = 0;
    double firedAt_ = -1;               // [s]; negative: not lately
    TipWay way_;                        // of a session that runs
    std::vector<glm::dvec3> shownWay_;  // [m]
};

}  // namespace palpate::render
