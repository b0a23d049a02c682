#include <tests/apps/sweep_plan.h>

#include <fstream>
#include <sstream>

namespace palpate::apps {

namespace fs = std::filesystem;

std::string shortPlan(int repeats, const std::string& more)
{
    return more + "scene = \"block\"\nrepeats = " + std::to_string(repeats) +
           "\noutputs = [\"force_n\", \"work_mj\", \"force_in_jnd = force_n / 0.07\"]\n"
           "[[axis]]\nname = \"youngs_kpa\"\nkey = \"tissue.fat.youngs_kpa\"\nlog_range = [1, 9]\nsteps = 3\n"
           "[[axis]]\nname = \"depth_mm\"\nkey = \"procedure.depth_mm\"\nvalues = [1, 2, 3, 4]\n"
           "[procedure]\nkind = \"press\"\nspeed_mm_s = 80\nhold_ms = 25\n"
           "[set]\nvolume.voxel_mm = 4\nvolume.parameters.width_mm = 40\nvolume.parameters.thickness_mm = 20\n"
           "volume.parameters.tumour_diameter_mm = 8\nvolume.parameters.tumour_centre_mm = 10\ntarget.aim_mm.y = 10\n"
           "tool.radius_mm = 6\nmodel.setting = \"fast\"\n";
}

std::vector<std::vector<std::string>> csvRows(const fs::path& file)
{
    std::vector<std::vector<std::string>> rows;
    std::istringstream text(readText(file));
    for (std::string line; std::getline(text, line);) {
        line.erase(line.find_last_not_of('\r') + 1);
        std::vector<std::string> row(1);
        for (const char c : line) {
            if (c == ',') {
                row.emplace_back();
            } else {
                row.back() += c;
            }
        }
        rows.push_back(row);
    }
    return rows;
}

std::string sameOnEveryRun(const fs::path& folder)
{
    std::string out;
    std::vector<bool> kept;
    for (const auto& row : csvRows(folder / "table.csv")) {
        for (std::size_t i = 0; i < row.size(); ++i) {
            if (kept.size() <= i) {
                kept.push_back(row[i] != "machine" && row[i] != "tick_us" && row[i] != "case_s");
            }
            out += kept[i] ? row[i] + "," : "";
        }
        out += "\n";
    }
    return out;
}

std::vector<int> childrenOf(int pid)
{
    std::vector<int> out;
    std::ifstream in("/proc/" + std::to_string(pid) + "/task/" + std::to_string(pid) + "/children");
    for (int child = 0; in >> child;) {
        out.push_back(child);
    }
    return out;
}

std::size_t casesIn(const fs::path& folder)
{
    std::size_t count = 0;
    std::error_code none;
    for (const auto& entry : fs::recursive_directory_iterator(folder / "cases", none)) {
        count += entry.path().extension() == ".json" ? 1 : 0;
    }
    return count;
}

}  // namespace palpate::apps
