#pragma once

#include <volume/label_image.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

// Real files of many writers and what independent readers counted in them: MANIFEST.md beside them.
namespace palpate::volume::manifest {

/// One line of the table.
struct Row {
    std::string name;            // folder/file, or folder/* for a DICOM series
    std::filesystem::path path;  // the file, or the folder of the series
    std::string format;          // "NRRD0004 short gzip", "DICOM SEG ..."
    std::string size;            // "512x512x20"
    std::string place;           // origin, spacing and direction, where the table has them
    std::string counts;          // "11 values: 0:43028583, 1:15949597"

    bool isSeries() const { return format.rfind("DICOM series", 0) == 0; }
    bool isSegmentation() const { return format.rfind("DICOM SEG", 0) == 0; }
};

/// Every line of the table; empty where the data are not there.
std::vector<Row> rows();
std::filesystem::path folder();

/// What a cell of counts says.
struct Counts {
    std::size_t different = 0;
    bool nonInteger = false;
    std::size_t nonFinite = 0;
    bool listed = false;                     // every value is in `voxels`
    std::map<double, std::uint64_t> voxels;  // value, voxels
    double least = 0, most = 0;
    std::uint64_t zero = 0;

    bool isLabelMap() const;  // by the rules of the importer, from what is counted
};
Counts countsOf(const Row& row);

/// Label value, voxels; zero included.
std::map<int, std::uint64_t> histogram(const LabelImage& image);

/// Segment number, voxels of a DICOM SEG's row.
std::map<int, std::uint64_t> segmentVoxels(const Row& row);

/// Origin, spacing [mm] and direction (row by row), or nothing where the table does not have them.
struct Place {
    bool given = false;
    std::vector<double> origin, spacing, direction;
};
Place placeOf(const Row& row);

}  // namespace palpate::volume::manifest
