#pragma once

#include <chainmail/elastic_body.h>

#include <cstdint>
#include <vector>

namespace palpate::chainmail {

/// Fraction of a cell that is held from which on all of it is: bone, but for the rounding of samples.
inline constexpr float whollyHeld = 0.98F;
/// Stiffness under which a cell is empty [Pa].
inline constexpr float minTissue = 0.01F;

/// Which nodes are held in space (nodes x 1): those around which half of the tissue is, and those of a cell of bone alone
/// that the bone reaches.
///
/// Bone thinner than a cell may hold none of these, and what lies behind it would be felt through it. So of each edge that
/// it crosses between two free nodes the nearer one is held. Where free nodes of a cell still lie on both sides of it, as
/// on a plate that runs obliquely, those of the nearer side are, if all of them are within half a cell of it. A rod that
/// crosses no edge of a cell and fills 8 % of it holds the nearest of its nodes.
///
/// So a plate may be up to half a cell off its place. Tissue between it and a held face of its cell is not strained there:
/// it counts as held in `materials`, and the next cell is as much softer as it would be longer with it.
/// @param cells      of `materials`, their middles as nodes
/// @param nodes      of the finest level; it begins at the corner of the first cell
std::vector<std::uint8_t> heldNodes(const volume::NodeGrid& cells, const volume::NodeGrid& nodes,
                                    std::vector<volume::CellMaterial>& materials);

/// Holds nodes of the next coarser level where what is held there holds none, being thinner than two cells of the fine
/// level: of each edge that it crosses between free nodes, the end with more of it around. So it parts what it parted. What
/// is but one or two nodes of its plane is left out. @pre coarse.fixed is known but for that, fine.diagonal is known
void holdThin(const CellLevel& fine, CellLevel& coarse);

}  // namespace palpate::chainmail
