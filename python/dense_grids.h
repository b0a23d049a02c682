#pragma once

#include <volume/tissue.h>

#include <cstdint>
#include <mutex>
#include <optional>
#include <vector>

namespace palpate::python {

/// Dense copies of the grids of one volume, which are made when first asked for, from any thread; all views look into
/// those.
class DenseGrids {
public:
    const std::vector<std::uint16_t>& labels(const volume::Tissue& tissue);
    const std::vector<float>& stiffness(const volume::Tissue& tissue);  // [Pa]
    const std::vector<float>& image(const volume::Tissue& tissue);      // empty: none

private:
    std::mutex making_;
    std::optional<std::vector<std::uint16_t>> labels_;
    std::optional<std::vector<float>> stiffness_, image_;
};

}  // namespace palpate::python
