#include <volume/export_source.h>

namespace palpate::volume {

namespace {

std::string_view metaType(Component component)
{
    return component == Component::u8 ? "MET_UCHAR" : component == Component::u16 ? "MET_USHORT" : "MET_FLOAT";
}

std::string textOf(Vec3 v)
{
    return fmt::format("{:.17g} {:.17g} {:.17g}", v.x, v.y, v.z);
}

}  // namespace

void writeMeta(const std::filesystem::path& file, const VoxelStream& voxels, const ExportOptions& options)
{
    const VoxelGrid& grid = voxels.grid;
    const Mat3& m = grid.affine.linear;
    const Vec3 spacing = grid.affine.spacing();
    const bool apart = file.extension() == ".mhd" || file.extension() == ".MHD";
    std::filesystem::path raw = file;
    raw.replace_extension(".raw");
    std::string header =
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
        "CompressedData = False\n";
    header += fmt::format("TransformMatrix = {} {} {}\n", textOf(m[0] / spacing.x), textOf(m[1] / spacing.y),
                          textOf(m[2] / spacing.z));
    header += fmt::format("Offset = {}\nCenterOfRotation = 0 0 0\n", textOf(1e3 * grid.affine.origin));
    header += fmt::format("ElementSpacing = {}\nDimSize = {} {} {}\n", textOf(1e3 * spacing), grid.size.x, grid.size.y,
                          grid.size.z);
    header += voxels.components > 1 ? fmt::format("ElementNumberOfChannels = {}\n", voxels.components) : "";
    header += fmt::format("ElementType = {}\nElementDataFile = {}\n", metaType(voxels.component),
                          apart ? raw.filename().string() : "LOCAL");
    if (apart) {
        OutputFile data(raw);
        writeSlices(data, voxels, false, options);
        data.finish();
    }
    OutputFile out(file);
    out.write(header);
    if (!apart) {
        writeSlices(out, voxels, false, options);
    }
    out.finish();
}

}  // namespace palpate::volume
