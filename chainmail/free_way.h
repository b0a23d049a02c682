#pragma once

#include <chainmail/elastic_contact.h>

#include <vector>

namespace palpate::chainmail {

/// What stops a tool: ElasticBody::held and bone.
/// @param cells  of `materials`, as for elasticBody()
/// @param nodes  of the finest level
void findStops(const volume::NodeGrid& cells, const std::vector<volume::CellMaterial>& materials,
               const volume::NodeGrid& nodes, ElasticBody& body);

/// How far a tool gets, from where it would lie on the surface at rest, until its front meets what is held in space; along
/// its length [m]: where half of the tissue around the front is, or in a plate of thin bone where that begins.
/// @param inward  unit vector
/// @param way     at most so far [m]
double freeWay(const ElasticBody& body, const ElasticTool& tool, Vec3 inward, double way) noexcept;

}  // namespace palpate::chainmail
