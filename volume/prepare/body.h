#pragma once

#include <volume/label_image.h>
#include <volume/prepare/steps.h>
#include <volume/resample.h>
#include <volume/tissue_table.h>

#include <functional>
#include <string>
#include <vector>

namespace palpate::prepare {

/// Adds voxels without a label to `labels`, until they cover the image `ct`: segmentations are often stored cropped. Throws
/// std::runtime_error where that makes too many.
void extendToImage(volume::LabelImage& labels, const volume::VoxelGrid& ct);

/// Finds the body around the labels in a CT: every voxel without a label gets what the CT says of it, and so becomes one of
/// the structures body_skin, body_fat, body_muscle, body_soft_tissue, body_bone, body_vessel, body_lung, body_gas, or stays
/// outside. A label always wins. What lies on the patient (table, clothes, cables) is no body. Each structure is reported
/// with its voxels and volume.
///
/// @param hu       the CT on the voxels of `image` [HU]; not a number where it has none (voxels x 1)
/// @param names    gets a row for each structure that was found, with a free label value
/// @param tell     is called with what is going on
/// Throws std::runtime_error where nothing in the CT is a body, the voxels are sheared, or the table lacks a tissue.
/// docs/researcher.md has the thresholds with their sources.
std::vector<PreparationStep> bodyFromImage(volume::LabelImage& image, std::vector<volume::LabelName>& names,
                                           std::vector<float> hu, const volume::TissueTable& table,
                                           const std::function<void(const std::string&)>& tell);

/// Invents a body around the labels where no image says what is there: all that lies within `thickness` [m] of a label, and
/// between labels, becomes soft tissue (structure invented_soft_tissue) with a skin outside (invented_skin). Voxels are
/// added where the volume ends too early. Throws as bodyFromImage() does.
std::vector<PreparationStep> bodyFromHull(volume::LabelImage& image, std::vector<volume::LabelName>& names,
                                          double thickness, const volume::TissueTable& table,
                                          const std::function<void(const std::string&)>& tell);

}  // namespace palpate::prepare
