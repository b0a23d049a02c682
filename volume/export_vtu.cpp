#include <volume/export_source.h>

#include <array>
#include <cstring>

namespace palpate::volume {

namespace {

constexpr std::uint8_t hexahedron = 12;  // VTK_HEXAHEDRON

// The arrays of a .vtu, behind one another as raw bytes: eight bytes of size, then the values.
class Appended {
public:
    template <typename T>
    std::string add(std::string_view type, std::string_view name, int components, const std::vector<T>& values)
    {
        const std::size_t at = bytes_.size();
        const std::uint64_t size = values.size() * sizeof(T);
        bytes_.resize(at + 8 + size);
        std::memcpy(bytes_.data() + at, &size, 8);
        std::memcpy(bytes_.data() + at + 8, values.data(), size);
        return fmt::format(
            "<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"appended\" offset=\"{}\"/>\n", type,
            name, components, at);
    }
    const std::string& bytes() const { return bytes_; }

private:
    std::string bytes_;
};

struct Mesh {
    std::vector<float> points, displacement;  // [mm] (points x 3)
    std::vector<std::uint8_t> tissue, types;
    std::vector<std::int64_t> corners, ends;
};

Mesh meshOf(const NodeGrid& grid, std::span<const std::uint8_t> tissue, std::span<const Vec3f> u)
{
    Mesh mesh;
    std::vector<std::int64_t> pointOf(grid.count(), -1);
    for (std::size_t n = 0; n < grid.count(); ++n) {
        if (tissue[n] == 0) {
            continue;
        }
        pointOf[n] = static_cast<std::int64_t>(mesh.tissue.size());
        mesh.tissue.push_back(tissue[n]);
        const Vec3 at = 1e3 * grid.position(grid.node(n));
        for (int k = 0; k < 3; ++k) {
            mesh.points.push_back(static_cast<float>(at[k]));
            mesh.displacement.push_back(1e3F * u[n][k]);
        }
    }
    // VTK's order: around the lower face, then around the upper one.
    constexpr std::array<std::array<int, 3>, 8> order{
        {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}};
    forEachIndex(Index3(0), grid.size - 2, [&](Index3 n) {
        std::array<std::int64_t, 8> corner{};
        bool whole = true;
        for (std::size_t c = 0; c < corner.size(); ++c) {
            corner[c] = pointOf[grid.offset(n + Index3(order[c][0], order[c][1], order[c][2]))];
            whole = whole && corner[c] >= 0;
        }
        if (whole) {
            mesh.corners.insert(mesh.corners.end(), corner.begin(), corner.end());
            mesh.ends.push_back(static_cast<std::int64_t>(mesh.corners.size()));
            mesh.types.push_back(hexahedron);
        }
    });
    return mesh;
}

}  // namespace

void exportVtu(const std::filesystem::path& file, const NodeGrid& grid, std::span<const std::uint8_t> tissue,
               std::span<const Vec3f> u)
{
    checkCount(file, "tissue", tissue.size(), grid.size);
    checkCount(file, "displacements", u.size(), grid.size);
    const Mesh mesh = meshOf(grid, tissue, u);
    Appended arrays;
    std::string xml =
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" "
        "header_type=\"UInt64\">\n<UnstructuredGrid>\n";
    xml += fmt::format("<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n", mesh.tissue.size(), mesh.types.size());
    xml += "<Points>\n" + arrays.add("Float32", "points_mm", 3, mesh.points) + "</Points>\n<Cells>\n";
    xml += arrays.add("Int64", "connectivity", 1, mesh.corners) + arrays.add("Int64", "offsets", 1, mesh.ends) +
           arrays.add("UInt8", "types", 1, mesh.types);
    xml += "</Cells>\n<PointData Vectors=\"displacement_mm\">\n" +
           arrays.add("Float32", "displacement_mm", 3, mesh.displacement) + arrays.add("UInt8", "tissue", 1, mesh.tissue);
    xml += "</PointData>\n</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_";
    OutputFile out(file);
    out.write(xml);
    out.write(arrays.bytes());
    out.write("\n</AppendedData>\n</VTKFile>\n");
    out.finish();
}

}  // namespace palpate::volume
