#pragma once

#include <volume/blurred_surface.h>
#include <volume/geometry.h>

#include <cstdint>
#include <span>
#include <vector>

// Inside volume/ only: distance transforms of dense arrays on a NodeGrid.
namespace palpate::volume {

/// Finds the nearest of `points` for every node.
///
/// @param nearest  index of a point, or -1 (nodes x 1). On entry each point is entered at the node in whose cell it lies
///                 (at most half a spacing away along each axis); on return every node has one, unless there is none at
///                 all.
///
/// Two sweeps, up and down through the slices, at the same time. Cost O(nodes).
/// Source: P.-E. Danielsson, "Euclidean Distance Mapping", Computer Graphics and Image Processing 14, 1980, in three
/// dimensions and with points that lie off the nodes.
void spreadNearest(Index3 size, std::span<const SurfacePoint> points, std::vector<std::int32_t>& nearest);

/// Signed distance [m], negative where fraction > iso, to the surface fraction = iso of the trilinear `fraction` (nodes x
/// 1). Where no surface crosses the grid, the diagonal of the grid with the sign of the side it lies on.
/// @param marked  1 at nodes: the surface next to these alone, negative at no other (nodes x 1); empty: all of it
std::vector<float> signedDistance(const NodeGrid& grid, std::span<const float> fraction, float iso,
                                  std::span<const std::uint8_t> marked = {});

/// The same to a surface from fractions, of which more than half are inside.
/// @param weight  of the surface's way back: 1 as it was computed
std::vector<float> signedDistance(const NodeGrid& grid, std::span<const float> fraction, const BlurredSurface& surface,
                                  float weight);

/// Volume where the trilinear interpolant of `distance` is negative [m^3].
double enclosedVolume(const NodeGrid& grid, std::span<const float> distance);

/// A volume [m^3], and the distances that it was computed from: empty where a part of the grid was enough.
struct Enclosed {
    double volume = 0;
    std::vector<float> distance;
};

/// What signedDistance(grid, fraction, surface, 1) encloses. Around a small surface it is computed, to the same bits, from
/// the nodes near it.
Enclosed enclosedBy(const NodeGrid& grid, std::span<const float> fraction, const BlurredSurface& surface);

/// The value between 0.05 and 0.6 whose isosurface encloses `volume` [m^3]; 0.5 when that does within 0.5 %.
/// At most nine tenths of the largest fraction, so that something is inside. Source of `fraction`: nodes x 1, trilinear.
float isoForVolume(const NodeGrid& grid, std::span<const float> fraction, double volume);

/// Shifts `distance` by at most half a spacing so that its trilinear interpolant encloses `volume` [m^3], where it misses
/// that by over 3 %: in structures thinner than a spacing the nodes alone do not see both walls.
void keepVolume(const NodeGrid& grid, std::vector<float>& distance, double volume);

/// Volume under the trilinear interpolant of `fraction` [m^3].
double integral(const NodeGrid& grid, std::span<const float> fraction);

}  // namespace palpate::volume
