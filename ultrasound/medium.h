#pragma once

#include <base/cells.h>
#include <channel/layout.h>

#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate::ultrasound {

/// Of a voxel's label, beside the row of its tissue (channel::rowBits): all within two voxels are the same; a core was
/// taken there.
inline constexpr std::uint8_t pureBit = 0x40, holeBit = 0x80;
/// What is not known: beyond the labels.
inline constexpr std::uint8_t unknown = pureBit | holeBit;
inline constexpr std::uint8_t compared = channel::rowBits | holeBit;

/// A body at rest as sound meets it: tissues and the logarithm of their impedance on a fine grid.
class Medium {
public:
    /// From the fine labels where there are some. Where there are none, as beyond the box around the procedure that they
    /// fill, from those of the display, whose borders are smoothed by quadratic splines on a grid up to three times as
    /// fine.
    Medium(const channel::Scenery& scenery, std::span<const std::uint8_t> labels, std::span<const std::uint8_t> fine);

    glm::dvec3 origin() const noexcept { return layer_.origin; }
    double spacing() const noexcept { return layer_.spacing; }
    glm::ivec3 size() const noexcept { return layer_.size; }
    /// Around all that is known, from `low` to below `high` [voxels from the origin]: 0 and size() where the labels are of
    /// one kind.
    glm::ivec3 low() const noexcept { return low_; }
    glm::ivec3 high() const noexcept { return high_; }

    /// Label of the voxel around `v` [voxels from the origin]: tissue row, pureBit, holeBit; `unknown` beyond.
    std::uint8_t label(glm::vec3 v) const noexcept;
    /// ln Z [MRayl], smoothed over a voxel, and its gradient [1/voxel].
    struct Impedance {
        float ln = 0;
        glm::vec3 slope{0};
    };
    Impedance impedanceAt(glm::vec3 v) const noexcept;
    /// ln Z where a label is pure [MRayl].
    float pureImpedance(std::uint8_t label) const noexcept { return static_cast<float>(code_[label & compared]) / codes; }
    /// What a label's tissue does to sound; a hole is filled with blood.
    const channel::TissueSound& sound(std::uint8_t label) const noexcept { return sound_[label & compared]; }
    /// The tissue's impedance [MRayl]; that of gel in air, which the labels tell.
    float impedance(std::uint8_t label) const noexcept;

    /// Makes `holes` of `radius` [m], and those of before that are not among them whole again. Returns whether anything has
    /// changed.
    bool punch(std::span<const channel::Hole> holes, double radius);

private:
    static constexpr float codes = 4096;  // of ln Z in steps

    struct Saved {
        std::size_t at = 0;
        std::uint8_t label = 0;
    };
    // A grid of labels, and of the impedances that follow from them.
    struct Layer {
        bool holds(glm::vec3 low, glm::vec3 high) const noexcept;
        std::size_t offset(glm::ivec3 n) const noexcept { return base::offsetOf(size, n); }

        glm::dvec3 origin{0.0};
        double spacing = 1e-3;
        glm::ivec3 size{0};
        std::vector<std::uint8_t> labels;
        std::vector<std::int16_t> lnZ;  // 4096 ln Z [MRayl]
        std::vector<Saved> saved;       // labels that holes have taken the place of, in the order of the holes
    };

    std::uint8_t labelAround(glm::vec3 v) const noexcept;
    static Impedance impedanceIn(const Layer& layer, glm::vec3 v) noexcept;
    static Layer refined(const channel::Scenery& scenery, std::span<const std::uint8_t> labels, double enough);
    void surround(const channel::Scenery& scenery, std::span<const std::uint8_t> labels);
    void finish(Layer& layer, glm::ivec3 low, glm::ivec3 high) const;
    void punch(Layer& layer, double radius) const;
    static void dig(Layer& layer, const channel::Hole& hole, double radius, glm::ivec3& low, glm::ivec3& high);

    Layer layer_;
    Layer around_;  // without labels where layer_ has the whole body
    glm::vec3 toAround_{0};
    float perVoxel_ = 1;  // of layer_, voxels of around_: v is there toAround_ + perVoxel_ v
    glm::ivec3 low_{0}, high_{0};
    std::array<channel::TissueSound, 256> sound_{};
    std::array<std::int16_t, 256> code_{};  // of a label's ln Z
    std::vector<channel::Hole> holes_;
};

}  // namespace palpate::ultrasound
