#pragma once

#include <haptics/session_model.h>

#include <cstdint>

namespace palpate::haptics {

/// Walls within one tissue that a needle's tip breaks through one by one: septa, vessels, ducts. They stand between the
/// Voronoi cells of random points, one in each cube of a grid (Worley, "A cellular texture basis function", SIGGRAPH 1996),
/// at the same places of the tissue at rest in every session.
///
/// The cell that `rest` lies in, as a number of its own.
/// @param rest     a place of the tissue at rest [m]
/// @param spacing  mean distance between walls along a straight line [m], over 0
std::uint64_t lobeAt(Vec3 rest, double spacing) noexcept;

/// What the wall between two cells holds beyond the cutting force [N]: exponentially distributed over walls.
/// @param one, other  from lobeAt(); in any order
/// @param mean        over all walls [N]
double wallForce(std::uint64_t one, std::uint64_t other, double mean) noexcept;

/// Whether needles meet inner walls in this tissue: the scene asks for them, and the tissue table says how they are.
bool hasWalls(const SessionModel& model, const volume::TissueRow& row) noexcept;

}  // namespace palpate::haptics
