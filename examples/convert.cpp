// Reads a label map in any format that Palpate knows and writes it in another, as the second name ends.
//
//   convert LABELS.nii.gz LABELS.seg.nrrd
#include <palpate/volume/export.h>
#include <palpate/volume/import.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <set>

using namespace palpate;

int main(int argc, char** argv)
{
    if (argc != 3) {
        std::fprintf(stderr, "usage: convert FROM TO\n");
        return 2;
    }
    try {
        volume::checkExportName(argv[2]);
        volume::ImportedLabels labels = volume::importLabels(argv[1]);
        for (const std::string& warning : labels.warnings) {
            std::fprintf(stderr, "convert: %s\n", warning.c_str());
        }
        const auto& values = labels.image.values;
        // Labels that the file does not name are called by their value.
        for (const std::uint16_t value : std::set(values.begin(), values.end())) {
            if (value != 0 && std::ranges::find(labels.names, value, &volume::LabelName::value) == labels.names.end()) {
                labels.names.push_back({value, "label " + std::to_string(value), ""});
            }
        }
        volume::exportLabels(argv[2], labels.image, labels.names);
        const Index3 size = labels.image.size;
        std::printf("%d x %d x %d voxels, %zu structures\n", size.x, size.y, size.z, labels.names.size());
        return 0;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "convert: %s\n", e.what());
        return 1;
    }
}
