#include <base/mapped.h>
#include <volume/grids.h>
#include <volume/import/dicom.h>
#include <volume/import/label_sink.h>

#include <fmt/ranges.h>
#include <openvdb/io/File.h>

#include <mutex>

namespace palpate::volume {

namespace {

constexpr double unit = 1e-3;  // a world unit of a foreign file is taken as a millimetre [m]

Vec3 vec(const openvdb::Vec3d& v)
{
    return {v.x(), v.y(), v.z()};
}

openvdb::GridBase::Ptr onlyGrid(const std::filesystem::path& file)
{
    static std::once_flag once;
    std::call_once(once, [] { openvdb::initialize(); });
    openvdb::io::File vdb(file.string());
    vdb.open(false);
    refuseIf((*vdb.getMetadata())["palpate_volume"] != nullptr, file, "is a volume already: 'palpate info' shows it");
    const openvdb::GridPtrVecPtr grids = vdb.readAllGridMetadata();
    if (grids->size() != 1) {
        const auto names = base::mapped<std::string>(*grids, [](const auto& grid) { return grid->getName(); });
        refuse(file, "holds {} grids ({}): save it with the one that holds the labels", grids->size(),
               fmt::join(names, ", "));
    }
    return vdb.readGrid(grids->front()->getName());
}

// Every voxel that `inside` accepts gets the label that it gives.
template <typename Grid, typename Label>
void fill(const std::filesystem::path& file, const Grid& grid, const ImportOptions& options, ImportedLabels& out,
          Label&& label)
{
    const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
    refuseIf(box.empty(), file, "no voxel is set, the grid has no active voxels: save the one that holds the labels");
    const openvdb::Coord dim = box.dim();
    LabelImage& image = out.image;
    image.size = checkedSize(file, {dim.x(), dim.y(), dim.z()});
    // Two voxels far apart make a box that nobody has memory for.
    constexpr std::size_t maxVoxels = std::size_t{1} << 30;
    if (image.offset({0, 0, image.size.z}) > maxVoxels) {
        refuse(file, "its active voxels spread over {} x {} x {}: crop it first", dim.x(), dim.y(), dim.z());
    }
    const openvdb::math::Transform& to = grid.transform();
    const openvdb::Vec3d first = box.min().asVec3d();
    image.affine.origin = unit * vec(to.indexToWorld(first));
    image.affine.linear = Mat3(unit * vec(to.indexToWorld(first + openvdb::Vec3d(1, 0, 0)) - to.indexToWorld(first)),
                               unit * vec(to.indexToWorld(first + openvdb::Vec3d(0, 1, 0)) - to.indexToWorld(first)),
                               unit * vec(to.indexToWorld(first + openvdb::Vec3d(0, 0, 1)) - to.indexToWorld(first)));
    LabelSink sink(file, image.size, LabelRules(false, options));
    const auto accessor = grid.getConstAccessor();
    std::vector<double> row(static_cast<std::size_t>(dim.x()));
    for (int k = 0; k < dim.z(); ++k) {
        for (int j = 0; j < dim.y(); ++j) {
            for (int i = 0; i < dim.x(); ++i) {
                row[static_cast<std::size_t>(i)] = label(accessor.getValue(box.min().offsetBy(i, j, k)));
            }
            sink.add(row);
        }
    }
    sink.finish(false, out);
}

template <typename Grid>
bool fillIf(const std::filesystem::path& file, const openvdb::GridBase& grid, const ImportOptions& options,
            ImportedLabels& out)
{
    const auto* typed = dynamic_cast<const Grid*>(&grid);
    if (typed == nullptr) {
        return false;
    }
    const bool surface = grid.getGridClass() == openvdb::GRID_LEVEL_SET;
    fill(file, *typed, options, out, [surface](auto v) { return surface ? (v < 0 ? 1.0 : 0.0) : static_cast<double>(v); });
    if (surface) {
        out.names.push_back({1, grid.getName(), ""});
        out.warnings.emplace_back("is a level set: its inside is taken as one structure");
    }
    return true;
}

}  // namespace

ImportedLabels vdbLabels(const std::filesystem::path& file, const ImportOptions& options)
{
    try {
        const openvdb::GridBase::Ptr grid = onlyGrid(file);
        refuseIf(!grid->transform().isLinear(), file, "its grid is bent (a frustum): resample it to a straight grid first");
        ImportedLabels out;
        if (!fillIf<openvdb::Int32Grid>(file, *grid, options, out) &&
            !fillIf<openvdb::Int64Grid>(file, *grid, options, out) &&
            !fillIf<openvdb::FloatGrid>(file, *grid, options, out) &&
            !fillIf<openvdb::DoubleGrid>(file, *grid, options, out)) {
            refuse(file, "its grid holds {}, not labels: save it as a grid of int32 or float", grid->valueType());
        }
        checkAffine(file, out.image.affine, options.sheared, out.warnings);
        placeAxes(options, out.image.affine, out.warnings);
        out.warnings.emplace_back("OpenVDB files do not say their unit: millimetres are assumed");
        return out;
    } catch (const openvdb::Exception& e) {
        refuse(file, "OpenVDB cannot read it ({}): get the file again", e.what());
    }
}

}  // namespace palpate::volume
