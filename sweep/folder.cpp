#include <sweep/folder.h>

#include <base/error.h>
#include <base/fnv.h>
#include <base/inputs.h>
#include <base/outputs.h>
#include <base/process.h>
#include <datasets/scene_text.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <fstream>
#include <iterator>
#include <limits>
#include <optional>
#include <stdexcept>
#include <system_error>

namespace palpate::sweep {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr std::size_t perFolder = 1000;
constexpr const char* unfinished = ".part";

std::string textOf(const fs::path& file)
{
    std::optional<std::string> text = base::contentOf(file);
    base::failIf(!text, "{}: cannot be read: check its name and permissions", file.native());
    return *std::move(text);
}

std::string hashOf(const std::string& bytes)
{
    base::Fnv hash;
    hash.addAll(std::span(bytes));
    return fmt::format("{} bytes, {:016x}", bytes.size(), hash.value);
}

json inputsOf(const datasets::Scene& scene)
{
    json inputs = json::object();
    for (const std::string& file : {scene.source.file.string(), scene.tissues}) {
        if (!file.empty()) {
            inputs[file] = hashOf(textOf(file));
        }
    }
    return inputs;
}

// What the cases follow from, as it is in the folder.
json ownOf(const std::string& plan, const std::string& scene)
{
    return {{"plan.toml", hashOf(plan)}, {"scene.toml", hashOf(scene)}};
}

// The folder's own base scene, whatever the plan calls it.
datasets::Scene sceneOfFolder(const std::string&, const fs::path& origin)
{
    const fs::path file = origin.parent_path() / "scene.toml";
    return datasets::parseScene(textOf(file), file);
}

// Whether scenes say the same. Both are written and read alike: one comes from a file that was, maybe by another build.
bool areAlike(const datasets::Scene& a, const datasets::Scene& b)
{
    const auto again = [](const datasets::Scene& s) {
        return datasets::sceneText(datasets::parseScene(datasets::sceneText(s), "scene.toml"));
    };
    return datasets::sceneText(a) == datasets::sceneText(b) || again(a) == again(b);
}

double cpuSeconds()
{
    timespec t{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

std::string lineOf(const json& entry)
{
    return entry.dump(-1, ' ', false, json::error_handler_t::replace);
}

// FNV-1a over the entry without its checksum.
std::string checksumOf(json entry)
{
    entry.erase("checksum");
    base::Fnv hash;
    const std::string text = lineOf(entry);
    hash.addAll(std::span(text));
    return fmt::format("{:016x}", hash.value);
}

// A value of a case's file; throws with its key.
template <class T>
T valueOf(const json& entry, const char* key, bool (json::*is)() const noexcept, const char* what)
{
    const auto at = entry.find(key);
    base::failIf(at == entry.end() || !((*at).*is)(), "key {} is {}{}", key,
                 at == entry.end() ? "missing, and should be " : "no ", what);
    return at->get<T>();
}

// Throws std::runtime_error ("what is wrong").
SweepRow parseRow(const std::string& text, std::size_t index, const SweepPlan& plan)
{
    const json entry = json::parse(text, nullptr, false);
    base::failIf(!entry.is_object(), "is no JSON object");
    SweepRow row;
    row.index = valueOf<std::size_t>(entry, "case", &json::is_number_unsigned, "whole number");
    base::failIf(row.index != index, "key case is {}", row.index);
    row.error = valueOf<std::string>(entry, "error", &json::is_string, "text");
    row.build = valueOf<std::string>(entry, "build", &json::is_string, "text");
    row.machine = valueOf<std::string>(entry, "machine", &json::is_string, "text");
    row.tickTime = 1e-6 * valueOf<double>(entry, "tick_us", &json::is_number, "number");
    row.seconds = valueOf<double>(entry, "case_s", &json::is_number, "number");
    const json outputs = valueOf<json>(entry, "outputs", &json::is_object, "object");
    for (const auto& output : plan.outputs) {
        const json value = outputs.value(output.name, json());
        base::failIf(!value.is_number() && !value.is_null(), "key outputs.{} is no number", output.name);
        row.outputs.push_back(value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN());
    }
    base::failIf(valueOf<std::string>(entry, "checksum", &json::is_string, "text") != checksumOf(entry),
                 "key checksum does not match");
    return row;
}

}  // namespace

std::pair<std::string, fs::path> planText(const std::string& given)
{
    const auto ready = builtInPlan(given);
    if (!ready.empty()) {
        return {std::string(ready), given + ".toml"};
    }
    base::failIf(fs::is_directory(given), "{}: is a folder: give a plan (.toml), and the folder with -o", given);
    if (!fs::exists(given)) {
        throw base::error("{}: no such plan; ready plans are: {}", given, fmt::join(builtInPlans(), ", "));
    }
    return {textOf(given), fs::absolute(given)};
}

void SweepFolder::begin()
{
    std::error_code failed;
    fs::create_directories(folder_ / "cases", failed);
    base::failIf(static_cast<bool>(failed), "{}: cannot be made ({})", folder_.string(), failed.message());
    const std::string scene = datasets::sceneText(plan_.base);
    base::writeWhole(folder_ / "scene.toml", scene);
    const json about{{"name", plan_.name}, {"inputs", inputsOf(plan_.base)}, {"own", ownOf(plan_.text, scene)}};
    base::writeWhole(folder_ / "sweep.json", about.dump(1));
    base::writeWhole(folder_ / "plan.toml", plan_.text);  // the last: it makes the folder a sweep
}

SweepFolder::SweepFolder(fs::path folder) : folder_(fs::absolute(std::move(folder)).lexically_normal())
{
    folder_ = folder_.has_filename() ? folder_ : folder_.parent_path();
}

SweepFolder SweepFolder::ofResults(const fs::path& folder)
{
    SweepFolder results(folder);
    const fs::path file = results.folder_ / "plan.toml";
    base::failIf(!fs::exists(file), "{}: holds no sweep: name the folder of a sweep", results.folder_.native());
    results.plan_ = parsePlan(textOf(file), file, sceneOfFolder, false);
    results.checkFiles();
    return results;
}

SweepFolder::SweepFolder(fs::path folder, const std::string& given, bool hold) : SweepFolder(std::move(folder))
{
    const fs::path file = folder_ / "plan.toml";
    std::pair<std::string, fs::path> text;
    if (!given.empty()) {
        text = planText(given);
    }
    if (!fs::exists(file)) {
        base::failIf(given.empty(), "{}: holds no sweep: {}", folder_.native(),
                     hold ? "give a plan" : "name the folder of a sweep");
        base::failIf(fs::exists(folder_) && !fs::is_directory(folder_), "{}: is a file: name a folder", folder_.native());
        base::failIf(fs::exists(folder_) && !fs::is_empty(folder_),
                     "{}: is not empty and holds no sweep: choose another folder", folder_.native());
        plan_ = parsePlan(text.first, text.second, namedScene);
        base::checkOutputFolder(folder_);
        base::makeFolders(folder_);
    }
    if (hold) {
        lock_.emplace(folder_);
    }
    if (!fs::exists(file)) {
        begin();
        return;
    }
    plan_ = parsePlan(textOf(file), file, sceneOfFolder);
    const json about = checkFiles();
    base::failIf(
        !given.empty() && text.first != plan_.text,
        "{}: holds another plan than {}: choose another folder, or leave out the plan to resume that of the folder",
        folder_.native(), given);
    checkInputs(about);
    base::failIf(
        !given.empty() && !areAlike(plan_.base, sceneOfPlan(text.first, text.second, namedScene)),
        "{}: its cases are of another scene than {} has now: choose another folder, or leave out the plan to resume "
        "with the scene of the folder",
        folder_.native(), given);
}

json SweepFolder::checkFiles()
{
    const json about = json::parse(textOf(folder_ / "sweep.json"), nullptr, false);
    base::failIf(!about.is_object(), "{}/sweep.json: is damaged: begin in another folder", folder_.native());
    const json own = ownOf(plan_.text, textOf(folder_ / "scene.toml"));
    for (const auto& [name, hash] : own.items()) {
        // A folder of an older build has no hash.
        base::failIf(about.contains("own") && hash != about["own"].value(name, std::string()),
                     "{}: was changed since the sweep began, and the cases that are done are of the old one: bring it "
                     "back, or begin in another folder",
                     (folder_ / name).native());
    }
    plan_.name = about.value("name", plan_.name);
    return about;
}

void SweepFolder::checkInputs(const json& about) const
{
    const json then = about.value("inputs", json::object()), now = inputsOf(plan_.base);
    for (const auto& [file, hash] : now.items()) {
        base::failIf(
            !then.is_object() || then.value(file, json()) != hash,
            "{}: {}, which its scene reads, has changed since the sweep began: bring it back, or begin in another folder",
            folder_.native(), file);
    }
}

fs::path SweepFolder::caseFile(std::size_t index) const
{
    return folder_ / "cases" / fmt::format("{:03}", index / perFolder) / fmt::format("{}.json", index);
}

bool SweepFolder::has(std::size_t index) const
{
    std::error_code none;
    const auto size = fs::file_size(caseFile(index), none);
    return !none && size > 0;
}

std::vector<std::optional<SweepRow>> SweepFolder::rows(std::vector<std::string>* damaged) const
{
    std::vector<std::optional<SweepRow>> rows(plan_.cases());
    for (std::size_t i = 0; i < rows.size(); ++i) {
        if (!has(i)) {
            continue;
        }
        try {
            rows[i] = parseRow(textOf(caseFile(i)), i, plan_);
        } catch (const std::runtime_error& e) {
            if (damaged != nullptr) {
                damaged->push_back(fmt::format("{}: {}", caseFile(i).string(), e.what()));
            }
        }
    }
    return rows;
}

void SweepFolder::write(const SweepRow& row) const
{
    json outputs = json::object();
    for (std::size_t i = 0; i < row.outputs.size(); ++i) {
        outputs[plan_.outputs[i].name] = std::isfinite(row.outputs[i]) ? json(row.outputs[i]) : json();
    }
    json entry{{"case", row.index},    {"error", row.error},     {"outputs", std::move(outputs)},
               {"build", row.build},   {"machine", row.machine}, {"tick_us", 1e6 * row.tickTime},
               {"case_s", row.seconds}};
    // Numbers as they will be read: the checksum is over those.
    entry = json::parse(lineOf(entry));
    entry["checksum"] = checksumOf(entry);
    const fs::path file = caseFile(row.index);
    std::error_code failed;
    fs::create_directories(file.parent_path(), failed);
    // Named after the process: two may write the same row, and either is whole.
    const fs::path half = file.parent_path() / fmt::format("{}.{}.{}{}", row.index, base::hostName(), getpid(), unfinished);
    std::ofstream out(half, std::ios::binary);
    out << lineOf(entry) << '\n';
    out.close();
    if (out && !failed) {
        fs::rename(half, file, failed);
    }
    if (!out || failed) {
        std::error_code ignored;
        fs::remove(half, ignored);
        throw std::runtime_error(file.string() + ": cannot be written: check the folder and the space on the disk");
    }
}

void SweepFolder::forget(std::size_t index) const
{
    std::error_code ignored;
    fs::remove(caseFile(index), ignored);
}

void SweepFolder::clean() const
{
    std::error_code none;
    for (const char* const inside : {"cases", "records"}) {
        for (const auto& entry : fs::recursive_directory_iterator(folder_ / inside, none)) {
            if (entry.path().extension() == unfinished) {
                fs::remove(entry.path(), none);
            }
        }
    }
}

fs::path SweepFolder::record(std::size_t index) const
{
    std::error_code failed;
    const fs::path file = folder_ / "records" / fmt::format("{}.db", index);
    fs::create_directories(file.parent_path(), failed);
    for (const char* const rest : {"", "-wal", "-shm"}) {
        fs::remove(file.string() + rest, failed);
    }
    return file;
}

SweepRow runCase(CaseRunner& runner, const SweepFolder& folder, std::size_t index, const std::string& build)
{
    SweepRow row;
    row.index = index;
    row.build = build;
    row.machine = base::hostName();
    const double before = cpuSeconds();
    try {
        auto result = runner.run(index, folder.plan().records ? folder.record(index) : fs::path());
        row.outputs = std::move(result.outputs);
        row.tickTime = result.tickTime;
    } catch (const RecordFailed&) {
        throw;
    } catch (const std::exception& e) {
        row.error = withoutPlace(e.what());
        std::replace(row.error.begin(), row.error.end(), '\n', ' ');
    }
    row.seconds = cpuSeconds() - before;
    return row;
}

}  // namespace palpate::sweep
