#pragma once

#include <channel/layout.h>
#include <render/deformation.h>
#include <render/leap_grid.h>
#include <render/ray_budget.h>
#include <render/shift_field.h>

#include <vtkGPUVolumeRayCastMapper.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkRenderer.h>
#include <vtkTextureObject.h>
#include <vtkVolume.h>

#include <glm/vec3.hpp>

#include <array>
#include <cstdint>
#include <vector>

class vtkShaderProgram;

namespace palpate::render {

enum class Quality : std::uint8_t { moving, still };

/// How the warning distances of vital structures are drawn.
inline constexpr std::array<float, 3> shellColour{1.0F, 0.72F, 0.10F};

/// Of a part of the whole, cut to [0, 1] and rounded.
std::uint8_t byteOf(float part) noexcept;

/// The body, ray cast, cut open along a plane. The volume at rest is uploaded once; the ray caster looks every sample up
/// where it lies at rest, so that a frame costs the same however much of the body moves and however fine it is. World
/// coordinates of everything drawn in 3-D are millimetres.
class VolumePicture {
public:
    VolumePicture(const channel::Scenery& scenery, const Deformation& deformation, vtkRenderer& renderer);
    VolumePicture& operator=(VolumePicture&&) = delete;
    ~VolumePicture();

    /// Shows the present deformation from the next prepare() on.
    void update(const Deformation& deformation);
    /// Draws the tissues anew, their opacity in the table times `factor` per row.
    void paint(const channel::Scenery& scenery, const Deformation& deformation,
               const std::array<float, channel::maxTissues>& factor);
    /// Draws the outside alone: all of the body in the colour of its skin, and opaque.
    void paintClosed(const channel::Scenery& scenery, const Deformation& deformation);
    /// Shows only what lies behind the plane through `point` [m], seen from where `normal` points to.
    void cut(glm::dvec3 point, glm::dvec3 normal);
    void uncut() { cutNormal_ = glm::dvec3(0.0); }
    /// Before a picture; the context must be current. `pixels`: size of the view.
    void prepare(Quality quality, bool software, double pixels);
    /// False when the picture was made without a body: VTK asks for what its shader needs from the second one on.
    bool shown() const noexcept { return shown_; }
    /// Whether this picture has other distances between rays or along them than the one before: VTK then makes buffers and
    /// textures anew in the midst of it, and in a window the body may be missing from what comes out.
    bool renewed() const noexcept { return renewed_; }
    /// After it: how long the whole picture took [s], from the state on. What moves is cast as finely as 30 pictures a
    /// second allow.
    void took(double seconds);

private:
    void computeLight(const channel::Scenery& scenery, const Deformation& deformation);
    void teachShader();
    void leaveWhole();
    /// Rays so many pixels apart, with steps of so many millimetres.
    void setSteps(double pixels, double length);
    void setUniforms(vtkShaderProgram& program);
    void setView(vtkShaderProgram& program, glm::dvec3 corner, glm::dvec3 whole);
    void upload();

    vtkRenderer& renderer_;
    channel::Grid grid_;
    std::vector<std::uint8_t> light_;  // per voxel
    LeapGrid way_;
    ShiftField field_;
    bool changed_ = true;
    bool moving_ = false;
    bool shown_ = false, renewed_ = false;
    RayBudget budget_;
    vtkNew<vtkImageData> image_;
    vtkNew<vtkTextureObject> shifts_, leaps_;
    vtkNew<vtkGPUVolumeRayCastMapper> mapper_;
    vtkNew<vtkVolume> volume_;
    glm::dvec3 cutPoint_{0.0}, cutNormal_{0.0};  // what lies where the normal points to is seen; 0: all
};

}  // namespace palpate::render
