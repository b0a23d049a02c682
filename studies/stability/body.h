#pragma once

#include <datasets/tables.h>
#include <volume/tissue.h>

#include <cstdint>
#include <functional>
#include <memory>

namespace palpate::studies {

/// Labels of the small bodies; 0 is air.
enum BodyLabel : std::uint16_t { bodySkin = 1, bodyFat = 2, bodyGland = 3, bodyBase = 5, bodyTumour = 6 };

/// The body whose label at p [mm] is `label(p)`, sampled at the middles of voxels of 1 mm between `low` and `high` [mm];
/// the base is of bone and held in space.
std::shared_ptr<const volume::Tissue> smallBody(Vec3 low, Vec3 high, const std::function<BodyLabel(Vec3)>& label,
                                                const volume::TissueTable& table = datasets::defaultTissues());

}  // namespace palpate::studies
