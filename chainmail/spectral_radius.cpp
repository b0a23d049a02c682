#include <chainmail/spectral_radius.h>

#include <chainmail/kernels.h>
#include <chainmail/window.h>

#include <cmath>
#include <random>
#include <vector>

namespace palpate::chainmail {

constexpr int powerSteps = 30;

// By power iteration; a start of random signs has a fraction of every eigenvector.
double spectralRadius(const CellLevel& level)
{
    const Index3 size = level.nodes.size;
    WindowFragments fragments(level, size);
    fragments.place(level, Index3(0));
    const Layout l = Layout::of(size.x, size.y, fragments.planes());
    const Kernels& k = kernels();
    std::vector<float> mu(l.count + Layout::lanes), lambda(mu), inverse(mu);
    LayerFields layers(l, size, !level.layers.empty());
    layers.place(level, Index3(0));
    std::vector<float> z(l.fieldSize()), az(l.fieldSize()), scratch(l.scratchSize());
    std::minstd_rand random(7);
    const float scale = static_cast<float>(level.nodes.spacing / 32.0);
    const auto start = [&](std::size_t at, float diagonal, bool isFixed) {
        inverse[at] = diagonal > 0.0F && !isFixed ? 1.0F / diagonal : 0.0F;
        for (std::size_t c = 0; c < 3; ++c) {
            z[c * l.count + at] = inverse[at] == 0.0F ? 0.0F : random() % 2 != 0 ? 1.0F : -1.0F;
        }
    };
    volume::forEachIndex(Index3(0), size - 1, [&](Index3 n) {
        const std::size_t from = level.nodes.offset(n);
        const std::size_t to = l.at(n.x, n.y, n.z);
        mu[to] = scale * level.mu[from];
        lambda[to] = scale * level.lambda[from];
        start(to, level.diagonal[from], level.fixed[from] != 0);
    });
    CutFields cuts(l, size);
    cuts.place(level, Index3(0));
    for (const WindowFragments::Placed& p : fragments.placed()) {
        cuts.set(p.node, level.fragments.cells[p.fragment].cut);
        mu[p.node] = scale * level.fragments.cells[p.fragment].mu;
        lambda[p.node] = scale * level.fragments.cells[p.fragment].lambda;
    }
    for (const WindowFragments::VirtualAt& v : fragments.virtuals()) {
        start(v.at, level.fragments.nodes[v.node].diagonal, level.fragments.nodes[v.node].isFixed);
    }
    const auto norm = [&] {
        std::array<double, 2> sums{};
        k.dots(z.data(), z.data(), z.data(), 3 * l.count, sums.data());
        return std::sqrt(sums[0]);
    };
    double radius = 0.0;
    for (int i = 0; i < powerSteps; ++i) {
        const double before = norm();
        if (before <= 0.0) {
            break;
        }
        fragments.share(z.data(), l.count);
        k.apply(l,
                {.mu = mu.data(),
                 .lambda = lambda.data(),
                 .layers = layers.view(),
                 .cuts = cuts.view(),
                 .filling = cuts.filling()},
                z.data(), az.data(), scratch.data());
        fragments.collect(az.data(), l.count);
        k.smoothFirst(static_cast<float>(1.0 / before), inverse.data(), az.data(), z.data(), l.count);
        radius = norm();
    }
    return radius > 0.0 ? radius : 1.0;
}

}  // namespace palpate::chainmail
