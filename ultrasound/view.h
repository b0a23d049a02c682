#pragma once

#include <channel/deformation.h>
#include <ultrasound/medium.h>
#include <ultrasound/transducer.h>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <cstdint>
#include <vector>

namespace palpate::ultrasound {

/// A needle in the picture, in the probe's frame [m].
struct Needle {
    std::vector<glm::vec3> shape;  // middle line, from the hub to the tip
    float radius = 1e-3F;
};

/// Echoes before the point spread: sample by sample, each a row of lines, at baseband.
struct EchoLines {
    int lines = 0, samples = 0;
    std::vector<float> re, im;  // (samples x lines)

    std::size_t at(int sample, int line) const noexcept
    {
        return static_cast<std::size_t>(sample) * static_cast<std::size_t>(lines) + static_cast<std::size_t>(line);
    }
};

/// What is left of the amplitude both ways, along each line in each plane.
struct Shade {
    int planes = 0, steps = 0, lines = 0;
    std::vector<float> left;  // (planes x steps x lines)

    std::size_t at(int plane, int step, int line) const noexcept
    {
        return (static_cast<std::size_t>(plane) * static_cast<std::size_t>(steps) + static_cast<std::size_t>(step)) *
                   static_cast<std::size_t>(lines) +
               static_cast<std::size_t>(line);
    }
};

/// A probe before a deformed body: the ways from the probe's frame to the lattice and to the voxels at rest.
class View {
public:
    /// All must outlive it.
    View(const Beam& beam, const Pose& pose, const channel::Deformation& body, const Medium& medium)
        : beam_(beam), pose_(pose), body_(body), medium_(medium), still_(body.still())
    {
        const double lattice = body.lattice().spacing, voxel = medium.spacing();
        latticeAt_ = glm::vec3((pose.face - channel::vec(body.lattice().origin)) / lattice);
        voxelAt_ = glm::vec3((pose.face - medium.origin()) / voxel);
        axes_[0] = glm::vec3(pose.lateral);
        axes_[1] = glm::vec3(pose.elevation);
        axes_[2] = glm::vec3(pose.axial);
        perSpacing_ = static_cast<float>(1 / lattice);
        perVoxel_ = static_cast<float>(1 / voxel);
        voxelsPerSpacing_ = static_cast<float>(lattice / voxel);
    }

    const Beam& beam() const noexcept { return beam_; }
    const channel::Deformation& body() const noexcept { return body_; }
    const Medium& medium() const noexcept { return medium_; }
    const Pose& pose() const noexcept { return pose_; }
    bool still() const noexcept { return still_; }

    /// From `p` in the probe's frame [m] to its place at rest [lattice spacings]. `shift`: where the search starts and
    /// ended.
    void follow(glm::vec3 p, glm::vec3& shift) const noexcept
    {
        constexpr float enough = 0.005F;  // [lattice spacings]: a hundredth of a millimetre
        if (!still_)
            body_.follow(latticeAt_ + perSpacing_ * inPatient(p), shift, enough);
    }
    /// The voxel of what is at `p` in the probe's frame [m] and at rest `shift` [lattice spacings] away.
    glm::vec3 voxel(glm::vec3 p, glm::vec3 shift) const noexcept
    {
        return voxelAt_ + perVoxel_ * inPatient(p) + voxelsPerSpacing_ * shift;
    }
    /// A direction of the patient's frame in the probe's.
    glm::vec3 inward(glm::vec3 d) const noexcept
    {
        return {glm::dot(d, axes_[0]), glm::dot(d, axes_[1]), glm::dot(d, axes_[2])};
    }
    /// A point of the patient's frame in the probe's [m].
    glm::vec3 local(glm::dvec3 p) const noexcept { return inward(glm::vec3(p - pose_.face)); }

private:
    glm::vec3 inPatient(glm::vec3 d) const noexcept { return d.x * axes_[0] + d.y * axes_[1] + d.z * axes_[2]; }

    const Beam& beam_;
    const Pose& pose_;
    const channel::Deformation& body_;
    const Medium& medium_;
    bool still_;
    glm::vec3 latticeAt_{0}, voxelAt_{0};
    std::array<glm::vec3, 3> axes_{};
    float perSpacing_ = 0, perVoxel_ = 0, voxelsPerSpacing_ = 0;
};

/// A hash that spreads every bit.
inline std::uint32_t scrambled(std::uint32_t h) noexcept
{
    h ^= h >> 16U;
    h *= 0x7feb352dU;
    h ^= h >> 15U;
    h *= 0x846ca68bU;
    return h ^ (h >> 16U);
}

}  // namespace palpate::ultrasound
