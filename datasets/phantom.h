#pragma once

#include <volume/tissue.h>

#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

namespace palpate::datasets {

/// Which phantom, and its parameters. Same spec, same volume, bit for bit.
struct PhantomSpec {
    std::string name = "breast";              // "breast", "layered", "block"
    std::uint64_t seed = 1;                   // every random choice
    double voxel = 1e-3;                      // edge of a voxel [m]
    std::map<std::string, double> numbers{};  // e.g. tumour_diameter_mm, tumour_depth_mm, tumours; see phantomParameters()
    std::map<std::string, std::string> words{};               // e.g. tumour_kind = "idc_high_grade"
    double memory = std::numeric_limits<double>::infinity();  // that it may take [bytes]: no part of what it is
};

/// One parameter of a phantom, for help and for checking scenes.
struct PhantomParameter {
    std::string name;
    std::string unit;
    std::string meaning;
    double low = 0, high = 0, standard = 0;  // numbers only
    std::string word;                        // standard value of a word; empty for numbers
    bool whole = false;                      // a count: no fractions
};

std::vector<std::string> phantomNames();
/// Parameters that phantom `name` takes. Throws std::runtime_error for a name that is not there.
std::vector<PhantomParameter> phantomParameters(const std::string& name);

/// Builds a phantom. Patient frame: the chest wall is behind (+y), the nipple in front (-y). Structures carry the names
/// "skin", "fat", "gland", "ligament", "duct", "artery", "vein", "muscle", "rib", "nipple", "chest_wall", "tumour"
/// ("tumour_2", ..). Throws std::runtime_error for an unknown name, parameter or a value out of range (value, unit and
/// range in the message), and for a layer or tumour that is too small for the voxels to have one.
volume::Tissue makePhantom(const PhantomSpec& spec, const volume::TissueTable& table);

}  // namespace palpate::datasets
