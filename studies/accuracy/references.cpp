#include <studies/accuracy/references.h>

#include <base/child_process.h>
#include <base/error.h>
#include <base/inputs.h>
#include <base/process.h>
#include <base/user_files.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <glm/geometric.hpp>

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>

namespace palpate::studies {

namespace fs = std::filesystem;

namespace {

std::vector<fs::path> referencesIn(const fs::path& folder)
{
    return base::filesWith(".ref", folder);
}

std::vector<fs::path> referencesIn(const ReferenceFolders& folders)
{
    std::vector<fs::path> files = referencesIn(folders.own);
    for (const fs::path& folder : folders.others) {
        const std::vector<fs::path> more = referencesIn(folder);
        files.insert(files.end(), more.begin(), more.end());
    }
    return files;
}

std::optional<fs::path> find(const std::string& key, const ReferenceFolders& folders)
{
    const auto files = referencesIn(folders);
    const auto found = std::ranges::find_if(files, [&](const fs::path& f) { return f.stem().string().ends_with(key); });
    return found == files.end() ? std::nullopt : std::optional(*found);
}

// Whether a reference presses where a scene's path does, but for the way in which the surface was read.
bool isNear(const ReferencePress& reference, const TrialPath& path)
{
    constexpr double beside = 1e-3;    // [m]
    constexpr double turned = 0.9848;  // cosine of 10 degrees
    const double far = path.tool.radius + path.gap;
    return glm::distance(reference.start + far * reference.inward, path.start + far * path.inward) < beside &&
           std::abs(reference.press - path.press) < beside && glm::dot(reference.inward, path.inward) > turned &&
           glm::dot(reference.sideways, path.sideways) > turned;
}

// A file that presses the same body nearly as `subject` does.
std::optional<fs::path> findNear(const AccuracySubject& subject, const std::string& law, const ReferenceFolders& folders)
{
    const std::string body =
        referenceKey(*subject.model->tissue, subject.path, subject.speed, law, subject.poissonCap(), false);
    for (const fs::path& file : referencesIn(folders)) {
        try {
            const ReferenceInfo info = loadReference(file).second;
            if (info.press && info.body == body && isNear(*info.press, subject.path)) {
                return file;
            }
        } catch (const std::runtime_error&) {  // damaged: told of where it is asked for by its name
        }
    }
    return std::nullopt;
}

// Scenes of the references that come with the program, by their files' names: SCENE-LAW-KEY.ref.
std::string scenesWith(const std::string& law, const ReferenceFolders& folders)
{
    std::set<std::string> scenes;
    for (const fs::path& folder : folders.others) {
        for (const fs::path& file : referencesIn(folder)) {
            const std::string name = file.stem();
            const std::size_t at = name.find("-" + law + "-");
            if (at != std::string::npos) {
                scenes.insert(name.substr(0, at));
            }
        }
    }
    return scenes.empty() ? "none" : fmt::format("{}", fmt::join(scenes, ", "));
}

void solve(const std::string& what, const AccuracySubject& subject, const std::string& law, const fs::path& file)
{
    const fs::path folder = file.parent_path();
    std::error_code failed;
    fs::create_directories(folder, failed);
    base::failIf(static_cast<bool>(failed), "{}: cannot be made ({}): name another folder with --references",
                 folder.native(), failed.message());
    std::vector<std::string> arguments{
        what,     "--law",      law, "--tool", subject.path.tool.name, "--speed", fmt::format("{:g}", 1e3 * subject.speed),
        "--save", file.string()};
    if (!subject.pathOf.empty()) {
        arguments.insert(arguments.end(), {"--path-of", subject.pathOf.string()});
    }
    const int status = runReferenceProgram(arguments);
    base::failIf(status != 0, "{}: palpate-reference did not solve its {} reference (exit status {}): its message is above",
                 what, law, status);
}

}  // namespace

ReferenceFolders referenceFolders(const fs::path& own)
{
    ReferenceFolders out;
    out.own = own;
    if (own.empty()) {
        const fs::path cache = base::userFolder(base::UserFolder::cache);
        out.own = (cache.empty() ? fs::temp_directory_path() / "palpate" : cache) / "references";
    }
    out.others = {base::programFolder().parent_path() / "share" / "palpate" / "references", PALPATE_REFERENCES};
    return out;
}

SolvedReference solvedReference(const std::string& what, AccuracySubject& subject, const std::string& law,
                                const ReferenceFolders& folders, const std::function<void(const std::string&)>& tell)
{
    const std::string key = referenceKey(*subject.model->tissue, subject.path, subject.speed, law, subject.poissonCap());
    const auto taken = [&](const fs::path& file) {
        subject.pathOf = subject.pathOf.empty() ? file : subject.pathOf;
        return loadReference(file);
    };
    if (const auto file = find(key, folders)) {
        return taken(*file);
    }
    if (const auto file = subject.pathOf.empty() ? findNear(subject, law, folders) : std::nullopt) {
        SolvedReference found = taken(*file);
        const Vec3 before = subject.path.start;
        subject.path = pressedBy(subject.path, *found.second.press);
        tell(fmt::format("{}: pressed where its reference is, {:.3f} mm beside the scene's entry", what,
                         1e3 * glm::distance(before, subject.path.start)));
        return found;
    }
    const std::string& scene = subject.model->scene.name;
    if (referenceProgram().empty()) {
        throw base::error(
            "{}: there is no {} reference for it (key {}), and palpate-reference, which solves one, was not "
            "built: build with -DPALPATE_REFERENCE=ON, or take scenes that have one: {}",
            what, law, key, scenesWith(law, folders));
    }
    tell(fmt::format("{}: {} reference by finite elements", what, law));
    const fs::path file = folders.own / fmt::format("{}-{}-{}.ref", scene, law, key);
    solve(what, subject, law, file);
    SolvedReference made = taken(file);
    base::failIf(made.second.key != key,
                 "{}: palpate-reference solved another problem (key {} instead of {}): both "
                 "programs must be of one build",
                 what, made.second.key, key);
    return made;
}

fs::path ourProgram(const std::string& name)
{
    const fs::path own = base::programFolder();
    for (const fs::path& folder : {own, own.parent_path() / "libexec" / "palpate"}) {
        if (access((folder / name).c_str(), X_OK) == 0) {
            return folder / name;
        }
    }
    const char* const path = std::getenv("PATH");
    std::istringstream folders(path != nullptr ? path : "");
    for (std::string folder; std::getline(folders, folder, ':');) {
        const fs::path file = fs::path(folder) / name;
        if (!folder.empty() && access(file.c_str(), X_OK) == 0) {
            return file;
        }
    }
    return {};
}

fs::path referenceProgram()
{
    return ourProgram("palpate-reference");
}

int runReferenceProgram(const std::vector<std::string>& arguments)
{
    base::Program program{{referenceProgram().string()}, {-1, STDERR_FILENO, -1}};
    program.words.insert(program.words.end(), arguments.begin(), arguments.end());
    return base::run(program);
}

}  // namespace palpate::studies
