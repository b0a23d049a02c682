#include <studies/stability/body.h>

#include <volume/label_image.h>

#include <glm/common.hpp>

#include <algorithm>
#include <array>
#include <iterator>

namespace palpate::studies {

std::shared_ptr<const volume::Tissue> smallBody(Vec3 low, Vec3 high, const std::function<BodyLabel(Vec3)>& label,
                                                const volume::TissueTable& table)
{
    constexpr double metres = 1e-3;
    volume::LabelImage image;
    image.size = Index3(glm::round(high - low));
    image.affine.linear = Mat3(metres);
    image.affine.origin = metres * (low + 0.5);
    image.values.resize(base::countOf(image.size));
    std::array<bool, bodyTumour + 1> there{};
    volume::forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        const BodyLabel at = label(low + Vec3(n) + 0.5);
        image.values[image.offset(n)] = at;
        there[at] = true;
    });
    std::vector<volume::LabelName> names{{0, "air", "air"}};
    const std::array<volume::LabelName, 5> known{{{bodySkin, "skin", "skin"},
                                                  {bodyFat, "fat", "fat"},
                                                  {bodyGland, "gland", "gland"},
                                                  {bodyBase, "base", "bone"},
                                                  {bodyTumour, "tumour", "idc_high_grade"}}};
    std::ranges::copy_if(known, std::back_inserter(names), [&](const auto& entry) { return there[entry.value]; });
    return std::make_shared<const volume::Tissue>(
        volume::Tissue::fromLabels(image, table, names, {{"made by", "palpate stability"}}));
}

}  // namespace palpate::studies
