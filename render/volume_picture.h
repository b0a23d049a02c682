#pragma once

#include <render/channel/layout.h>
#include <render/deformation.h>

#include <vtkGPUVolumeRayCastMapper.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPlane.h>
#include <vtkRenderer.h>
#include <vtkVolume.h>

#include <glm/vec3.hpp>

#include <array>
#include <cstdint>
#include <vector>

namespace palpate::render {

enum class Quality : std::uint8_t { moving, still };

/// The body, ray cast, cut open along a plane. World coordinates of everything drawn in 3-D are millimetres.
class VolumePicture {
public:
    VolumePicture(const channel::Scenery& scenery, const Deformation& deformation, vtkRenderer& renderer);

    /// Draws `box` anew; all else stays as it was.
    void update(const Deformation& deformation, const VoxelBox& box);
    /// Shows only what lies behind the plane through `point` [m], seen from where `normal` points to.
    void cut(glm::dvec3 point, glm::dvec3 normal);
    /// `pixels`: size of the view.
    void setQuality(Quality quality, bool software, double pixels);

private:
    using Pixel = std::array<std::uint8_t, 4>;  // RGB, opacity

    void paintRest(const channel::Scenery& scenery, const Deformation& deformation);
    Pixel restPixel(glm::dvec3 p) const noexcept;

    channel::Grid grid_;
    std::vector<Pixel> rest_;  // per voxel
    vtkNew<vtkImageData> image_;
    vtkNew<vtkGPUVolumeRayCastMapper> mapper_;
    vtkNew<vtkVolume> volume_;
    vtkNew<vtkPlane> plane_;
};

}  // namespace palpate::render
