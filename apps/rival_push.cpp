#include <apps/rival_push.h>
#include <base/build.h>
#include <base/error.h>
#include <base/mapped.h>
#include <base/outputs.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include <cstdio>
#include <exception>
#include <fstream>

namespace palpate::apps {

using nlohmann::json;

namespace {

std::vector<Vec3> vectorsIn(const json& list)
{
    return base::mapped<Vec3>(
        list, [&](const json& v) { return Vec3(v.at(0).get<double>(), v.at(1).get<double>(), v.at(2).get<double>()); });
}

std::string rowsOf(std::span<const Vec3> vectors)
{
    std::string rows;
    for (const Vec3& v : vectors) {
        rows += fmt::format("{:.9g},{:.9g},{:.9g}\n", v.x, v.y, v.z);
    }
    return rows;
}

}  // namespace

double RivalPush::tetVolume(std::size_t tet) const
{
    const auto edge = [&](std::size_t i) { return points[tets[tet][i]] - points[tets[tet][0]]; };
    return glm::dot(edge(1), glm::cross(edge(2), edge(3))) / 6.0;
}

RivalPush readRivalPush(const std::filesystem::path& folder)
{
    const std::filesystem::path file = folder / "push.json";
    std::ifstream in(file);
    base::failIf(!in, "{}: cannot be read: palpate accuracy --rival writes it", file.native());
    try {
        const json push = json::parse(in);
        RivalPush out;
        out.points = vectorsIn(push.at("points_m"));
        push.at("tets").get_to(out.tets);
        push.at("surface_triangles").get_to(out.triangles);
        push.at("held_points").get_to(out.held);
        for (const json& m : push.at("materials")) {
            out.materials.push_back({m.at("youngs_modulus_pa"), m.at("poisson_ratio")});
        }
        push.at("tet_material").get_to(out.material);
        out.density = push.at("density_kg_m3");
        out.radius = push.at("tool").at("radius_m");
        out.tick = push.at("tick_s");
        out.centre = vectorsIn(push.at("tool_centre_m"));
        push.at("look_ticks").get_to(out.looks);
        return out;
    } catch (const json::exception& e) {
        throw base::error("{}: cannot be read as a push of palpate accuracy --rival: {}", file.string(), e.what());
    }
}

void writeRivalResults(const std::filesystem::path& folder, const RivalResults& results)
{
    std::string displacements = "ux_m,uy_m,uz_m\n", times = "processor_s\n";
    for (const auto& u : results.u) {
        displacements += rowsOf(u);
    }
    for (const double seconds : results.seconds) {
        times += fmt::format("{:.6g}\n", seconds);
    }
    base::writeWhole(folder / "displacements.csv", displacements);
    base::writeWhole(folder / "forces.csv", "fx_n,fy_n,fz_n\n" + rowsOf(results.force));
    base::writeWhole(folder / "times.csv", times);
}

int rivalMain(int argc, char** argv, const std::string& name, const std::string& about,
              const std::function<RivalResults(const RivalPush&, const std::filesystem::path& folder)>& solve)
{
    CLI::App app(about, name);
    app.set_version_flag("--version", std::string(base::build()));
    std::string folder;
    app.add_option("folder", folder, "Folder with push.json, to which the results are written")->required();
    app.failure_message([&](const CLI::App*, const CLI::Error& e) { return fmt::format("{}: {}\n", name, e.what()); });
    try {
        app.parse(argc, argv);
        writeRivalResults(folder, solve(readRivalPush(folder), folder));
        return 0;
    } catch (const CLI::ParseError& e) {
        return app.exit(e) == 0 ? 0 : 2;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "%s: %s\n", name.c_str(), e.what());
        return 1;
    }
}

}  // namespace palpate::apps
