#pragma once

#include <volume/prepare/mapping.h>

#include <datasets/label_map.h>

// Inside volume/prepare/ only: whose label map a file's labels are.
namespace palpate::prepare {

const volume::LabelName* find(const std::vector<volume::LabelName>& names, std::uint16_t value);

/// The built-in map whose names and values are those of all labels, or null. Names alone tell: 3, 11 and 20 are a kidney, a
/// lung and a bowel to one segmenter, and bundles of white matter to another. Null too where several maps fit that make
/// different tissues of the labels.
const datasets::LabelMap* recognised(const volume::ImportedLabels& labels, const LabelCounts& counts);

/// The built-in maps that have all values of a file without names, those that have least beside them first, and what each
/// makes of its largest labels: for the user to choose from. Empty where there is none.
std::string offers(const volume::ImportedLabels& labels, const LabelCounts& counts);

}  // namespace palpate::prepare
