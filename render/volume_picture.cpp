#include <render/volume_picture.h>

#include <base/units.h>
#include <render/ray_shader.h>

#include <GL/glew.h>
#include <vtkCallbackCommand.h>
#include <vtkCamera.h>
#include <vtkCommand.h>
#include <vtkMatrix4x4.h>
#include <vtkOpenGLRenderWindow.h>
#include <vtkOpenGLState.h>
#include <vtkPiecewiseFunction.h>
#include <vtkShaderProgram.h>
#include <vtkShaderProperty.h>
#include <vtkVolumeProperty.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <string>

namespace palpate::render {
using units::mm;

std::uint8_t byteOf(float part) noexcept
{
    return static_cast<std::uint8_t>(std::lround(255.0F * std::clamp(part, 0.0F, 1.0F)));
}

namespace {

// Binomial filter of five along one axis: the steps of voxels would show in the light as rings.
void blur(std::vector<float>& values, std::size_t size, std::size_t stride)
{
    if (size < 5)
        return;
    std::vector<float> line(size);
    for (std::size_t block = 0; block < values.size(); block += size * stride)
        for (std::size_t start = block; start < block + stride; ++start) {
            for (std::size_t n = 0; n < size; ++n)
                line[n] = values[start + n * stride];
            for (std::size_t n = 2; n + 2 < size; ++n)
                values[start + n * stride] =
                    (line[n - 2] + 4 * line[n - 1] + 6 * line[n] + 4 * line[n + 1] + line[n + 2]) / 16;
        }
}

// Light on the border of a tissue: `step` is the change of opacity around the voxel, `light` the direction to the lamp.
float lambert(glm::vec3 step, glm::vec3 light) noexcept
{
    const float length = glm::length(step);
    if (!(length > 0))
        return 1;
    constexpr float border = 0.03F;  // a change from which on it counts as one
    const float lit = 0.72F + 0.28F * glm::dot(-step / length, light);
    return glm::mix(1.0F, lit, std::min(1.0F, length / border));
}

// A texture of bytes, `components` for each texel.
void fill(vtkTextureObject& texture, vtkOpenGLRenderWindow& window, int filter, glm::ivec3 size, int components,
          const void* bytes)
{
    texture.SetContext(&window);
    texture.SetMinificationFilter(filter);
    texture.SetMagnificationFilter(filter);
    texture.SetWrapS(vtkTextureObject::ClampToEdge);
    texture.SetWrapT(vtkTextureObject::ClampToEdge);
    texture.SetWrapR(vtkTextureObject::ClampToEdge);
    texture.Create3DFromRaw(static_cast<unsigned>(size.x), static_cast<unsigned>(size.y), static_cast<unsigned>(size.z),
                            components, VTK_UNSIGNED_CHAR, const_cast<void*>(bytes));
}

// The row of a label; air for rows that the table does not have.
std::size_t rowOf(const channel::Scenery& scenery, std::uint8_t label) noexcept
{
    const std::uint8_t row = label & channel::rowBits;
    return row < scenery.tissues ? row : 0;
}

}  // namespace

VolumePicture::VolumePicture(const channel::Scenery& scenery, const Deformation& deformation, vtkRenderer& renderer)
    : renderer_(renderer), grid_(scenery.labels), way_(leapGrid(scenery.labels, deformation.labels()))
{
    const double spacing = grid_.spacing * mm;
    image_->SetDimensions(grid_.size[0], grid_.size[1], grid_.size[2]);
    image_->SetSpacing(spacing, spacing, spacing);
    image_->SetOrigin(grid_.origin[0] * mm, grid_.origin[1] * mm, grid_.origin[2] * mm);
    image_->AllocateScalars(VTK_UNSIGNED_CHAR, 4);
    computeLight(scenery, deformation);
    std::array<float, channel::maxTissues> plain{};
    plain.fill(1);
    paint(scenery, deformation, plain);

    vtkNew<vtkPiecewiseFunction> opacity;
    opacity->AddPoint(0, 0);
    opacity->AddPoint(255, 1);
    // Colour and opacity come per voxel, so that the sampler blends colours and never label values.
    vtkVolumeProperty& property = *volume_->GetProperty();
    property.IndependentComponentsOff();
    property.SetScalarOpacity(opacity);
    property.SetInterpolationTypeToLinear();
    property.ShadeOff();
    mapper_->SetInputData(image_);
    mapper_->SetAutoAdjustSampleDistances(0);
    volume_->SetMapper(mapper_);
    teachShader();
    leaveWhole();
    renderer.AddVolume(volume_);
}

VolumePicture::~VolumePicture() = default;

// Shading in the ray caster would cost a software renderer three times the frame.
void VolumePicture::computeLight(const channel::Scenery& scenery, const Deformation& deformation)
{
    const auto labels = deformation.labels();
    std::vector<float> body(labels.size());
    constexpr float present = 0.05F;  // so that the border of a clear tissue is lit as well
    for (std::size_t i = 0; i < labels.size(); ++i) {
        const std::size_t row = rowOf(scenery, labels[i]);
        body[i] = row == 0 ? 0.0F : present + scenery.tissue[row].opacity;
    }
    const std::array<std::size_t, 3> size{static_cast<std::size_t>(grid_.size[0]), static_cast<std::size_t>(grid_.size[1]),
                                          static_cast<std::size_t>(grid_.size[2])};
    const std::array<std::size_t, 3> stride{1, size[0], size[0] * size[1]};
    constexpr int passes = 2;
    for (std::size_t pass = 0; pass < 3 * passes; ++pass)
        blur(body, size[pass % 3], stride[pass % 3]);
    const glm::vec3 light = glm::normalize(glm::vec3(-0.4F, -0.7F, -0.6F));
    light_.resize(labels.size());
    std::size_t i = 0;
    for (std::size_t z = 0; z < size[2]; ++z)
        for (std::size_t y = 0; y < size[1]; ++y)
            for (std::size_t x = 0; x < size[0]; ++x, ++i) {
                const auto along = [&](std::size_t n, std::size_t last, std::size_t to) {
                    return body[n < last ? i + to : i] - body[n > 0 ? i - to : i];
                };
                const glm::vec3 step(along(x, size[0] - 1, stride[0]), along(y, size[1] - 1, stride[1]),
                                     along(z, size[2] - 1, stride[2]));
                light_[i] = byteOf(lambert(step, light));
            }
}

void VolumePicture::paint(const channel::Scenery& scenery, const Deformation& deformation,
                          const std::array<float, channel::maxTissues>& factor)
{
    constexpr float shellOpacity = 0.30F;
    const auto labels = deformation.labels();
    // The air takes the colour of the first tissue, so that blended borders stay free of dark fringes.
    const auto& fringe = scenery.tissue[1].colour;
    auto* pixels = static_cast<std::array<std::uint8_t, 4>*>(image_->GetScalarPointer());
    for (std::size_t i = 0; i < labels.size(); ++i) {
        const std::size_t row = rowOf(scenery, labels[i]);
        const bool shell = (labels[i] & channel::shellBit) != 0;
        const float light = static_cast<float>(light_[i]) / 255;
        const auto& colour = row == 0 ? fringe : shell ? shellColour : scenery.tissue[row].colour;
        const float opacity = row == 0 ? 0 : std::max(factor[row] * scenery.tissue[row].opacity, shell ? shellOpacity : 0);
        pixels[i] = {byteOf(light * colour[0]), byteOf(light * colour[1]), byteOf(light * colour[2]), byteOf(opacity)};
    }
    image_->Modified();
}

void VolumePicture::paintClosed(const channel::Scenery& scenery, const Deformation& deformation)
{
    const auto labels = deformation.labels();
    const auto& skin = scenery.tissue[1].colour;  // of the first tissue, which that of the outside is
    auto* pixels = static_cast<std::array<std::uint8_t, 4>*>(image_->GetScalarPointer());
    for (std::size_t i = 0; i < labels.size(); ++i) {
        const float light = static_cast<float>(light_[i]) / 255;
        pixels[i] = {byteOf(light * skin[0]), byteOf(light * skin[1]), byteOf(light * skin[2]),
                     byteOf(rowOf(scenery, labels[i]) == 0 ? 0.0F : 1.0F)};
    }
    image_->Modified();
}

void VolumePicture::teachShader()
{
    vtkShaderProperty& shader = *volume_->GetShaderProperty();
    const auto before = [&](const std::string& mark, const char* ours) {
        shader.AddFragmentShaderReplacement(mark, true, ours + ("\n" + mark), true);
    };
    before("//VTK::RenderToImage::Dec", ray_shader::declarations);
    before("//VTK::DepthPeeling::Ray::PathCheck", ray_shader::march);
    for (const char* mark : ray_shader::unwanted)
        shader.AddFragmentShaderReplacement(mark, true, "", true);
    vtkNew<vtkCallbackCommand> tell;
    tell->SetClientData(this);
    tell->SetCallback([](vtkObject*, unsigned long, void* self, void* program) {
        static_cast<VolumePicture*>(self)->setUniforms(*static_cast<vtkShaderProgram*>(program));
    });
    mapper_->AddObserver(vtkCommand::UpdateShaderEvent, tell);
}

// Where there are fewer rays than pixels, VTK draws them into a smaller picture that begins at its own corner, but lets the
// window's scissors cut it where the view lies in the window: of a view that does not begin in the lower left corner hardly
// a ray would be left. The view itself needs no scissors, since its viewport bounds it.
void VolumePicture::leaveWhole()
{
    vtkNew<vtkCallbackCommand> cut;
    cut->SetClientData(&renderer_);
    cut->SetCallback([](vtkObject*, unsigned long event, void* renderer, void*) {
        auto* window = vtkOpenGLRenderWindow::SafeDownCast(static_cast<vtkRenderer*>(renderer)->GetRenderWindow());
        vtkOpenGLState& state = *window->GetState();
        if (event == vtkCommand::VolumeMapperRenderStartEvent)
            state.vtkglDisable(GL_SCISSOR_TEST);
        else
            state.vtkglEnable(GL_SCISSOR_TEST);
    });
    mapper_->AddObserver(vtkCommand::VolumeMapperRenderStartEvent, cut);
    mapper_->AddObserver(vtkCommand::VolumeMapperRenderEndEvent, cut);
}

void VolumePicture::setUniforms(vtkShaderProgram& program)
{
    shown_ = true;
    const glm::dvec3 count(channel::sizeOf(grid_));
    const glm::dvec3 whole = count * grid_.spacing;  // of the texture [m]; the first voxel's middle is half a voxel inside
    const glm::dvec3 corner = vec(grid_.origin) - 0.5 * grid_.spacing;
    glm::dvec3 scale(0.0), offset(-1.0), reach(0.0);
    if (field_.size.x > 0) {
        const glm::dvec3 box = glm::dvec3(field_.size) * field_.spacing;
        scale = whole / box;
        offset = (corner - field_.origin + 0.5 * field_.spacing) / box;
        reach = 255.0 / 127.0 * field_.largest / whole;
    }
    const auto set = [&](const char* name, glm::dvec3 v) {
        const std::array<float, 3> value{static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
        program.SetUniform3f(name, value.data());
    };
    set("palpateScale", scale);
    set("palpateOffset", offset);
    set("palpateReach", reach);
    set("palpateBlocks", count / static_cast<double>(LeapGrid::side));
    set("palpateWhole", whole * mm);
    program.SetUniformf("palpateEnough", moving_ ? 0.97F : 0.99F);
    setView(program, corner, whole);
    shifts_->Activate();
    program.SetUniformi("palpateShift", shifts_->GetTextureUnit());
    leaps_->Activate();
    program.SetUniformi("palpateLeaps", leaps_->GetTextureUnit());
}

// How the rays go, in texture coordinates of the volume, which begins at `corner` and is `whole` wide [m].
void VolumePicture::setView(vtkShaderProgram& program, glm::dvec3 corner, glm::dvec3 whole)
{
    vtkCamera& camera = *renderer_.GetActiveCamera();
    const double* eye = camera.GetPosition();
    const glm::vec3 at((glm::dvec3(eye[0], eye[1], eye[2]) / mm - corner) / whole);
    program.SetUniform3f("palpateEye", &at.x);
    vtkNew<vtkMatrix4x4> world;
    vtkMatrix4x4::Invert(camera.GetCompositeProjectionTransformMatrix(renderer_.GetTiledAspectRatio(), -1, 1), world);
    std::array<float, 16> fromScreen{};  // columns
    for (int column = 0; column < 4; ++column)
        for (int row = 0; row < 4; ++row) {
            const double w = world->GetElement(3, column);
            const double value = row == 3 ? w : (world->GetElement(row, column) / mm - corner[row] * w) / whole[row];
            fromScreen[static_cast<std::size_t>(4 * column + row)] = static_cast<float>(value);
        }
    program.SetUniformMatrix4x4("palpateFromScreen", fromScreen.data());
    const glm::dvec3 normal = cutNormal_ * whole;
    const bool cut = cutNormal_ != glm::dvec3(0.0);
    const std::array<float, 4> plane{static_cast<float>(normal.x), static_cast<float>(normal.y),
                                     static_cast<float>(normal.z),
                                     cut ? static_cast<float>(glm::dot(cutNormal_, corner - cutPoint_)) : 1.0F};
    program.SetUniform4f("palpateCut", plane.data());
}

void VolumePicture::update(const Deformation& deformation)
{
    sample(deformation, field_);
    changed_ = true;
}

// Before VTK begins a picture: in the middle of one a new texture would take the place of the volume.
void VolumePicture::upload()
{
    if (!changed_)
        return;
    changed_ = false;
    vtkOpenGLRenderWindow* window = vtkOpenGLRenderWindow::SafeDownCast(renderer_.GetRenderWindow());
    window->Start();
    if (leaps_->GetHandle() == 0)
        fill(*leaps_, *window, vtkTextureObject::Nearest, way_.size, 1, way_.blocks.data());
    const ShiftField::Texel none{128, 128, 128, 255};
    if (field_.size.x > 0)
        fill(*shifts_, *window, vtkTextureObject::Linear, field_.size, 4, field_.texels.data());
    else
        fill(*shifts_, *window, vtkTextureObject::Linear, glm::ivec3(1), 4, &none);
}

void VolumePicture::cut(glm::dvec3 point, glm::dvec3 normal)
{
    cutPoint_ = point;
    cutNormal_ = -normal;
}

void VolumePicture::prepare(Quality quality, bool software, double pixels)
{
    moving_ = quality == Quality::moving;
    upload();
    const glm::dvec3 extent = glm::dvec3(channel::sizeOf(grid_)) * grid_.spacing * mm;
    const double voxel = std::max(grid_.spacing * mm, std::max({extent.x, extent.y, extent.z}) / 128);
    if (!software || quality == Quality::still) {
        setSteps(1, (software ? 1.0 : 0.5) * voxel);
        return;
    }
    const double apart = budget_.apart(pixels);
    setSteps(apart, std::clamp(0.75 * apart, 1.0, 3.0) * voxel);
}

void VolumePicture::setSteps(double pixels, double length)
{
    const auto apart = static_cast<float>(pixels), along = static_cast<float>(length);
    renewed_ = mapper_->GetImageSampleDistance() != apart || mapper_->GetSampleDistance() != along;
    mapper_->SetImageSampleDistance(apart);
    mapper_->SetSampleDistance(along);
}

void VolumePicture::took(double seconds)
{
    if (moving_)
        budget_.took(seconds);
}

}  // namespace palpate::render
