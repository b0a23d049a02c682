#include <render/volume_picture.h>

#include <vtkPiecewiseFunction.h>
#include <vtkVolumeProperty.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace palpate::render {
namespace {

constexpr double mm = 1e3;

// Light on the border of a tissue, baked into its colour: shading in the ray caster would cost a software renderer three
// times the frame. `step` is the change of opacity around the voxel, `light` the direction to the lamp.
double lambert(glm::dvec3 step, glm::dvec3 light) noexcept
{
    const double length = glm::length(step);
    if (!(length > 0))
        return 1.0;
    constexpr double border = 0.03;  // a change from which on it counts as one
    const double lit = 0.72 + 0.28 * glm::dot(-step / length, light);
    return glm::mix(1.0, lit, std::min(1.0, length / border));
}

std::uint8_t byte(float value) noexcept
{
    return static_cast<std::uint8_t>(std::lround(255.0F * std::clamp(value, 0.0F, 1.0F)));
}

// Binomial filter of five along one axis: the steps of voxels would show in the light as rings.
void blur(std::vector<float>& values, std::size_t size, std::size_t stride)
{
    std::vector<float> line(size);
    for (std::size_t start = 0; start < values.size(); ++start) {
        if (start / stride % size != 0)
            continue;
        for (std::size_t n = 0; n < size; ++n)
            line[n] = values[start + n * stride];
        for (std::size_t n = 2; n + 2 < size; ++n)
            values[start + n * stride] = (line[n - 2] + 4 * line[n - 1] + 6 * line[n] + 4 * line[n + 1] + line[n + 2]) / 16;
    }
}

}  // namespace

VolumePicture::VolumePicture(const channel::Scenery& scenery, const Deformation& deformation, vtkRenderer& renderer)
    : grid_(scenery.labels)
{
    paintRest(scenery, deformation);
    const double spacing = grid_.spacing * mm;
    image_->SetDimensions(grid_.size[0], grid_.size[1], grid_.size[2]);
    image_->SetSpacing(spacing, spacing, spacing);
    image_->SetOrigin(grid_.origin[0] * mm, grid_.origin[1] * mm, grid_.origin[2] * mm);
    image_->AllocateScalars(VTK_UNSIGNED_CHAR, 4);
    std::memcpy(image_->GetScalarPointer(), rest_.data(), rest_.size() * sizeof(Pixel));

    vtkNew<vtkPiecewiseFunction> opacity;
    opacity->AddPoint(0, 0);
    opacity->AddPoint(255, 1);
    // Colour and opacity come per voxel, so that the sampler blends colours and never label values.
    vtkVolumeProperty& property = *volume_->GetProperty();
    property.IndependentComponentsOff();
    property.SetScalarOpacity(opacity);
    property.SetInterpolationTypeToLinear();
    property.ShadeOff();
    // A tissue's opacity is meant for a layer of this thickness: with it fat stays clear over the depth of a breast.
    constexpr double layer = 6;  // [mm]
    property.SetScalarOpacityUnitDistance(layer);
    mapper_->SetInputData(image_);
    mapper_->SetAutoAdjustSampleDistances(0);

    volume_->SetMapper(mapper_);
    renderer.AddVolume(volume_);
}

void VolumePicture::paintRest(const channel::Scenery& scenery, const Deformation& deformation)
{
    const auto labels = deformation.labels();
    const auto rowOf = [&](std::size_t at) { return labels[at] < scenery.tissues ? labels[at] : std::uint8_t{0}; };
    std::vector<float> body(labels.size());
    constexpr float present = 0.05F;  // so that the border of a clear tissue is lit as well
    for (std::size_t i = 0; i < labels.size(); ++i)
        body[i] = rowOf(i) == 0 ? 0.0F : present + scenery.tissue[rowOf(i)].opacity;
    const std::array<std::size_t, 3> size{static_cast<std::size_t>(grid_.size[0]), static_cast<std::size_t>(grid_.size[1]),
                                          static_cast<std::size_t>(grid_.size[2])};
    const std::array<std::size_t, 3> stride{1, size[0], size[0] * size[1]};
    constexpr int passes = 2;
    for (std::size_t pass = 0; pass < 3 * passes; ++pass)
        blur(body, size[pass % 3], stride[pass % 3]);

    const glm::dvec3 light = glm::normalize(glm::dvec3(-0.4, -0.7, -0.6));
    // The air takes the colour of the first tissue, so that blended borders stay free of dark fringes.
    const auto& fringe = scenery.tissue[1].colour;
    rest_.resize(labels.size());
    for (std::size_t i = 0; i < labels.size(); ++i) {
        const std::size_t row = rowOf(i);
        if (row == 0) {
            rest_[i] = {byte(fringe[0]), byte(fringe[1]), byte(fringe[2]), 0};
            continue;
        }
        glm::dvec3 step(0.0);
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const std::size_t n = i / stride[axis] % size[axis];
            const float above = body[n + 1 < size[axis] ? i + stride[axis] : i], below = body[n > 0 ? i - stride[axis] : i];
            step[static_cast<int>(axis)] = static_cast<double>(above - below);
        }
        const auto shade = static_cast<float>(lambert(step, light));
        const channel::TissueLook& look = scenery.tissue[row];
        rest_[i] = {byte(shade * look.colour[0]), byte(shade * look.colour[1]), byte(shade * look.colour[2]),
                    byte(look.opacity)};
    }
}

VolumePicture::Pixel VolumePicture::restPixel(glm::dvec3 p) const noexcept
{
    const glm::dvec3 last(grid_.size[0] - 1, grid_.size[1] - 1, grid_.size[2] - 1);
    const glm::dvec3 g = glm::clamp((p - vec(grid_.origin)) / grid_.spacing, glm::dvec3(0.0), last - 1e-6);
    const glm::dvec3 low = glm::floor(g), part = g - low;
    const auto nx = static_cast<std::size_t>(grid_.size[0]), ny = static_cast<std::size_t>(grid_.size[1]);
    const std::size_t at =
        (static_cast<std::size_t>(low.z) * ny + static_cast<std::size_t>(low.y)) * nx + static_cast<std::size_t>(low.x);
    const std::size_t row = nx, layer = nx * ny;
    const auto differs = [&](std::size_t other) {
        return std::bit_cast<std::uint32_t>(rest_[at]) ^ std::bit_cast<std::uint32_t>(rest_[other]);
    };
    // Inside a tissue all eight are the same.
    if ((differs(at + 1) | differs(at + row) | differs(at + row + 1) | differs(at + layer) | differs(at + layer + 1) |
         differs(at + layer + row) | differs(at + layer + row + 1)) == 0)
        return rest_[at];
    std::array<float, 4> sum{};
    for (std::size_t k = 0; k < 8; ++k) {
        const std::size_t dx = k & 1U, dy = (k >> 1U) & 1U, dz = k >> 2U;
        const auto w = static_cast<float>((dx != 0 ? part.x : 1 - part.x) * (dy != 0 ? part.y : 1 - part.y) *
                                          (dz != 0 ? part.z : 1 - part.z));
        const Pixel& pixel = rest_[at + dz * layer + dy * row + dx];
        for (std::size_t c = 0; c < 4; ++c)
            sum[c] += w * static_cast<float>(pixel[c]);
    }
    Pixel result{};
    for (std::size_t c = 0; c < 4; ++c)
        result[c] = static_cast<std::uint8_t>(sum[c] + 0.5F);
    return result;
}

void VolumePicture::update(const Deformation& deformation, const VoxelBox& box)
{
    if (box.empty())
        return;
    auto* pixels = static_cast<Pixel*>(image_->GetScalarPointer());
    const auto nx = static_cast<std::size_t>(grid_.size[0]), ny = static_cast<std::size_t>(grid_.size[1]);
    for (int z = box.low.z; z < box.high.z; ++z)
        for (int y = box.low.y; y < box.high.y; ++y) {
            glm::vec3 shift(0);
            for (int x = box.low.x; x < box.high.x; ++x) {
                const std::size_t at =
                    (static_cast<std::size_t>(z) * ny + static_cast<std::size_t>(y)) * nx + static_cast<std::size_t>(x);
                const glm::dvec3 p = vec(grid_.origin) + grid_.spacing * glm::dvec3(x, y, z);
                const glm::dvec3 rest = deformation.rest(p, shift);
                pixels[at] = rest == p ? rest_[at] : restPixel(rest);
            }
        }
    image_->Modified();
}

void VolumePicture::cut(glm::dvec3 point, glm::dvec3 normal)
{
    const glm::dvec3 at = point * mm;
    plane_->SetOrigin(at.x, at.y, at.z);
    plane_->SetNormal(-normal.x, -normal.y, -normal.z);
    mapper_->RemoveAllClippingPlanes();
    mapper_->AddClippingPlane(plane_);
}

void VolumePicture::setQuality(Quality quality, bool software, double pixels)
{
    const double voxel = grid_.spacing * mm;
    if (!software) {
        mapper_->SetImageSampleDistance(1.0F);
        mapper_->SetSampleDistance(static_cast<float>(0.5 * voxel));
        return;
    }
    // What one core casts in about 15 ms [rays].
    constexpr double affordable = 40e3, fine = 1.5, coarsest = 4.0;
    const bool moving = quality == Quality::moving;
    const double apart = moving ? std::clamp(std::sqrt(pixels / affordable), fine, coarsest) : fine;
    mapper_->SetImageSampleDistance(static_cast<float>(apart));
    mapper_->SetSampleDistance(static_cast<float>((moving ? 2.0 : 1.0) * voxel));
}

}  // namespace palpate::render
