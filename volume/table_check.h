#pragma once

#include <volume/tissue_table.h>

// Inside volume/ only.
namespace palpate::volume {

/// Refuses a table that no force can be computed from, whether it is given or was stored with a volume; datasets/ asks for
/// more of a table in a file. Throws std::runtime_error that says which tissue and which number.
void checkTable(const TissueTable& table);

}  // namespace palpate::volume
