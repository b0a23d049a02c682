#pragma once

#include <ultrasound/kernels.h>
#include <ultrasound/rest_shifts.h>
#include <ultrasound/view.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

namespace palpate::ultrasound {

/// Speckle of breast fat below a perfect mirror, rms [dB]: backscatter 0.0143 /cm/sr at 9 MHz (PMC4618705) times half the
/// pulse's length times the aperture's solid angle.
inline constexpr float fatEcho = -46;

/// Scatterers that are fixed in the tissue at rest and move with it: blocks of rest space, each with 32 of equal strength
/// and at places from one of 256 patterns. A block is moved as a whole, by the displacement and its gradient at its middle:
///
///     x = X + u(X),   F = 1 + grad u,   echo of scatterer j at (l, z):   a_j A exp(-y^2 / 2 sigma_y^2) exp(4 pi i z /
///     lambda)
///
/// Of equal strength and evenly but not regularly placed: Gaussian strengths need several times as many for the same
/// statistics. Sources: Gjerald et al., IEEE TUFFC 59:885, 2012; Starkov et al., IJCARS 2019.
class Scatterers {
public:
    Scatterers();

    /// Echo strengths are looked up again from the labels.
    void forget() { std::fill(known_.begin(), known_.end(), Known::no); }
    /// How much echoes vary within a tissue, 0 to 1.
    void setVariation(float fraction);
    /// Finds the blocks that lie in the picture now.
    void find(const View& view, const Medium& medium);
    /// Adds their echoes.
    void splat(const View& view, const Shade& shade, EchoLines& echoes);
    /// One echo of strength `level` [dB over fat] from the point `at` of the probe's frame, as a scatterer's.
    void splatPoint(const View& view, const Shade& shade, glm::vec3 at, float level, EchoLines& echoes);

    std::size_t blocks() const noexcept { return chosen_.size(); }
    /// Of the cache, which goes with what pictures have shown up to a limit [bytes].
    std::size_t memory() const noexcept;

private:
    struct Pattern {
        std::array<float, perBlock> x, y, z;  // in [-1/2, 1/2]
    };
    struct Block {
        std::array<std::uint8_t, perBlock> strength;  // 2 (dB over fat) + 128, 0: nothing
    };
    // Echoes at baseband while they are added: real and imaginary part side by side, so that two lines are one register.
    struct Sum {
        using Lanes = float __attribute__((vector_size(16)));

        void clear(int lineCount, int sampleCount);
        // `echo` of `line` and the next one, shared out between `sample` and the next one, which gets `part`.
        void add(int sample, int line, float part, Lanes echo) noexcept;
        void addTo(EchoLines& echoes) const;

        int lines = 0, samples = 0;
        std::vector<float> complex;  // (samples x lines x 2)
    };
    enum class Known : std::uint8_t { no, some, nothing };
    // A block in the picture: which one of the body's, and where it is kept.
    struct Chosen {
        std::uint32_t id = 0, kept = 0;
    };

    void prepare(const View& view, const Medium& medium);
    bool nearPicture(const Beam& beam, float l, float z) const;
    void findAlong(const View& view, glm::vec3 first, int looks);
    std::uint32_t keptAt(glm::ivec3 n);
    glm::vec3 cornerOf(std::uint32_t id) const;
    void fill(const Chosen& chosen, glm::vec3 corner, const Medium& medium);
    void place(const View& view, glm::vec3 corner, const Pattern& pattern, BlockEchoes& out, float& depth,
               float& off) const;
    void add(const View& view, const Shade& shade, const Block& block, const BlockEchoes& at);
    BlockScale scaleAt(const View& view, float depth) const;

    std::vector<Pattern> patterns_;
    std::array<float, 256> level_{};  // amplitude of a strength
    std::vector<float> norm_;         // by sample: makes the rms of fat's speckle what it is to be
    float variation_ = 1;
    glm::ivec3 first_{0}, size_{0};        // of the body, in blocks
    float edge_ = 0, voxelsPerBlock_ = 0;  // [m], [voxels]
    // Blocks are kept in bricks of 8 x 8 x 8, which are made when one of theirs comes into a picture, so that memory goes
    // with the picture and not with the body.
    glm::ivec3 bricks_{0};                // of the body
    std::vector<std::uint32_t> brickAt_;  // by brick of the body: 1 + its place among those that are made; 0: not made
    std::vector<std::uint32_t> stamp_;    // by kept block: the last pass that chose it
    std::vector<Known> known_;
    std::vector<Block> block_;
    std::vector<Chosen> chosen_;
    RestShifts rest_;  // of a row of looks
    Sum sum_;
    std::uint32_t pass_ = 0;
};

}  // namespace palpate::ultrasound
