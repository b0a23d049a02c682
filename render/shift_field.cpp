#include <render/shift_field.h>

#include <base/cells.h>

#include <glm/common.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::render {
namespace {

constexpr double affordable = 80e3;  // nodes in every frame: some milliseconds

std::uint8_t signedByte(float fraction) noexcept
{
    return static_cast<std::uint8_t>(128.5F + 127.0F * fraction);  // over zero: it is rounded
}

}  // namespace

void sample(const Deformation& deformation, ShiftField& out)
{
    const VoxelBox& box = deformation.touched();
    out.size = glm::ivec3(0);
    if (box.empty())
        return;
    const channel::Grid& labels = deformation.grid();
    const glm::dvec3 low = vec(labels.origin) + labels.spacing * glm::dvec3(box.low);
    const glm::dvec3 high = low + labels.spacing * glm::dvec3(box.high - box.low);
    // On the lattice's own nodes, where the shift has its kinks.
    const double lattice = deformation.lattice().spacing;
    const glm::dvec3 corner = vec(deformation.lattice().origin);
    out.origin = corner + lattice * glm::floor((low - corner) / lattice);
    for (out.spacing = 0.5 * lattice;; out.spacing *= 2) {
        out.size = glm::ivec3(glm::ceil((high - out.origin) / out.spacing)) + 1;
        if (static_cast<double>(out.size.x) * out.size.y * out.size.z <= affordable)
            break;
    }
    const std::size_t nodes = base::countOf(out.size);
    out.shifts.resize(nodes);
    out.texels.resize(nodes);
    const glm::vec3 first((out.origin - corner) / lattice);
    const auto apart = static_cast<float>(out.spacing / lattice);
    float largest = 0;
    std::size_t at = 0;
    for (int z = 0; z < out.size.z; ++z)
        for (int y = 0; y < out.size.y; ++y) {
            glm::vec3 shift(0);
            for (int x = 0; x < out.size.x; ++x) {
                deformation.follow(first + apart * glm::vec3(x, y, z), shift);
                const glm::vec3 metres = static_cast<float>(lattice) * shift;
                largest = std::max({largest, std::abs(metres.x), std::abs(metres.y), std::abs(metres.z)});
                out.shifts[at++] = metres;
            }
        }
    out.largest = largest;
    const float scale = largest > 0 ? 1 / largest : 0;
    for (std::size_t i = 0; i < nodes; ++i)
        out.texels[i] = {signedByte(scale * out.shifts[i].x), signedByte(scale * out.shifts[i].y),
                         signedByte(scale * out.shifts[i].z), 255};
}

}  // namespace palpate::render
