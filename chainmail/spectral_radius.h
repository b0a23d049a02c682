#pragma once

#include <chainmail/elastic_body.h>

namespace palpate::chainmail {

/// The largest eigenvalue of D^-1 A, D the diagonal of the level's operator A; 1 where nothing can move.
/// @pre the level has its diagonal
double spectralRadius(const CellLevel& level);

}  // namespace palpate::chainmail
