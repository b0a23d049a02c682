#pragma once

#include <reference/smooth_labels.h>
#include <reference/surfaces.h>

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

namespace palpate::reference {

/// Names the facets that cross others, each as its three points in order.
using CrossingFacets = std::function<std::vector<std::array<std::uint32_t, 3>>(const Surfaces&)>;

/// Surfaces between tissues without a mesher: surface nets on cells about `size` long [m].
///
/// Every face between two cells of different tissue is two triangles, and every corner of such cells one point that all of
/// them share. Left there, faces are those of voxels and cannot cross. Points then move to the mean of their neighbours
/// and, where two tissues meet, to the border between them; each stays within a cell around its corner. The points of
/// facets that cross all the same go half way back, and so on: it ends, at the latest with the corners.
///
/// What lies on a flat side stays on it. The seed of a piece is the middle of its deepest cell.
/// Source: S. F. F. Gibson, "Constrained elastic surface nets: generating smooth surfaces from binary segmented data",
/// MICCAI 1998.
Surfaces surfaceNets(const SmoothLabels& labels, double size, const CrossingFacets& crossing);

}  // namespace palpate::reference
