#include <training/case.h>

#include <base/error.h>
#include <base/outputs.h>
#include <datasets/approach.h>
#include <datasets/scene_text.h>
#include <datasets/toml_section.h>
#include <session/open.h>

#include <fmt/format.h>

#include <unistd.h>

#include <string>

namespace palpate::training {

namespace fs = std::filesystem;

namespace {

std::string caseText(const NewCase& wanted, const datasets::Scene& scene, double depth)
{
    using datasets::tomlString;
    const std::string target = scene.target;
    return fmt::format(
        "title = {}\nscene = \"scene.toml\"\ndifficulty = {}\ntrains = [\"core biopsy\"]\n"
        "measures = [\"total\", \"best_target_pct\", \"targeting_error_mm\", \"vital_contacts\", \"passes\", "
        "\"beyond_target_mm\"]\nbriefing = [\n  {},\n  \"Touch the skin and push until it gives way.\",\n"
        "  {},\n  \"Fire, and draw the needle back.\",\n]\nlicence = {}\nsource = {}\n",
        tomlString(wanted.title.empty() ? wanted.volume.stem().string() : wanted.title), wanted.difficulty,
        tomlString(fmt::format("Take a core of the {}, {:.0f} mm below the skin.", target, 1e3 * depth)),
        tomlString(
            fmt::format("Advance until the tip is at the near rim of the {}: the gun throws the needle {:.0f} mm on.",
                        target, 1e3 * scene.tool.throwLength)),
        tomlString(wanted.licence), tomlString("made of " + wanted.volume.filename().string()));
}

}  // namespace

Case makeCase(const NewCase& wanted)
{
    base::failIf(fs::exists(wanted.folder), "{}: exists already; choose another name or remove it", wanted.folder.native());
    base::failIf(wanted.volume.extension() != ".vdb", "{}: a case is made of a volume (.vdb): palpate import makes one",
                 wanted.volume.native());
    const volume::Tissue tissue = session::loadVolume(wanted.volume);
    const fs::path normal = fs::absolute(wanted.folder).lexically_normal();
    const fs::path folder = normal.has_filename() ? normal : normal.parent_path();  // of "name/"
    const fs::path part = folder.string() + fmt::format(".{}.part", ::getpid());
    datasets::Scene scene = datasets::sceneForVolume(wanted.volume, tissue, wanted.target);
    const auto ways = datasets::proposeApproaches(scene, tissue, 1);
    scene.entry = ways.at(0).approach.entry;
    scene.aim = ways.at(0).approach.aim;
    scene.source.file = "volume.vdb";
    scene.name = folder.filename().string();
    base::makeFolders(part);
    try {
        fs::copy_file(wanted.volume, part / "volume.vdb");
        base::writeWhole(part / "scene.toml", datasets::sceneText(scene));
        base::writeWhole(part / caseFile, caseText(wanted, scene, ways.at(0).length));
        loadCase(part);
        datasets::loadScene(part / "scene.toml");
        fs::rename(part, folder);
    } catch (...) {
        std::error_code none;
        fs::remove_all(part, none);
        throw;
    }
    return loadCase(folder);
}

void namePicture(const Case& made, const std::string& picture)
{
    const fs::path file = made.folder / caseFile;
    const std::string text = datasets::readText(file);
    // Before any table, a key is the case's own.
    base::writeWhole(file, fmt::format("picture = {}\n{}", datasets::tomlString(picture), text));
    loadCase(made.folder);
}

}  // namespace palpate::training
