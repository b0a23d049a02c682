#include <sweep/run.h>

#include <base/build.h>
#include <base/counted.h>
#include <base/error.h>
#include <base/outputs.h>
#include <base/split.h>
#include <datasets/scene_text.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <numeric>
#include <optional>
#include <ranges>
#include <set>

namespace palpate::sweep {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t longestName = 100;  // of a folder for a list of cases

std::pair<std::size_t, std::size_t> partOf(const std::string& shard)
{
    const auto slash = shard.find('/');
    const auto k = base::numberIn<std::size_t>(std::string_view(shard).substr(0, slash));
    const auto n = base::numberIn<std::size_t>(slash == std::string::npos ? std::string_view()
                                                                          : std::string_view(shard).substr(slash + 1));
    base::failIf(!k || !n || *k < 1 || *k > *n, "--shard {}: must be K/N, part K of N, with K from 1 to N", shard);
    return {*k, *n};
}

void checkSamePlan(const SweepFolder& to, const SweepFolder& from)
{
    base::failIf(
        from.plan().text != to.plan().text || datasets::sceneText(from.plan().base) != datasets::sceneText(to.plan().base),
        "{}: is of another plan or scene than {}: it cannot be merged, move it elsewhere", from.path().native(),
        to.path().native());
}

// Of plans that keep records. Whole or not at all: there is no row of it yet.
void copyRecord(const fs::path& from, const SweepFolder& to, std::size_t index)
{
    const fs::path file = from / "records" / fmt::format("{}.db", index);
    if (fs::exists(file)) {
        const fs::path whole = to.record(index), half = whole.string() + ".part";
        fs::copy_file(file, half, fs::copy_options::overwrite_existing);
        fs::rename(half, whole);
    }
}

// A row that comes from a shard.
struct MergedRow {
    fs::path shard;
    SweepRow row;
};

// Folders of shards, and of runs on some cases.
std::vector<fs::path> partsIn(const fs::path& folder)
{
    std::vector<fs::path> parts;
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(folder / "shards", none)) {
        if (fs::exists(entry.path() / "plan.toml")) {
            parts.push_back(entry.path());
        }
    }
    return parts;
}

bool hasCases(const fs::path& folder)
{
    const SweepFolder sweep(folder, "", false);
    return std::ranges::any_of(std::views::iota(std::size_t{0}, sweep.plan().cases()),
                               [&](std::size_t i) { return sweep.has(i); });
}

// Rows that the folder lacks, or has only with an error; by case.
std::map<std::size_t, MergedRow> rowsToMerge(const SweepFolder& to, const std::vector<std::optional<SweepRow>>& there,
                                             const std::vector<fs::path>& shards)
{
    std::map<std::size_t, MergedRow> out;
    for (const fs::path& part : shards) {
        const SweepFolder shard(part, "", false);
        checkSamePlan(to, shard);
        for (const auto& row : shard.rows()) {
            const auto before = row ? out.find(row->index) : out.end();
            const SweepRow* const old = before != out.end()        ? &before->second.row
                                        : row && there[row->index] ? &*there[row->index]
                                                                   : nullptr;
            if (row && (old == nullptr || (old->failed() && !row->failed()))) {
                out[row->index] = {shard.path(), *row};
            }
        }
    }
    return out;
}

// The merged table is of one build.
void checkOneBuild(const SweepFolder& to, const std::vector<std::optional<SweepRow>>& there,
                   const std::map<std::size_t, MergedRow>& come)
{
    std::set<std::string> builds;
    for (const auto& row : there) {
        if (row && !come.contains(row->index)) {
            builds.insert(row->build);
        }
    }
    for (const auto& [index, merged] : come) {
        builds.insert(merged.row.build);
    }
    base::failIf(builds.size() > 1 && !come.empty(),
                 "{}: the shards are of different builds, {}: compute them with one build, or add --any-build (the "
                 "table names the build of each case)",
                 to.path().native(), fmt::join(builds, " and "));
}

}  // namespace

std::vector<std::size_t> remainingCases(const SweepFolder& folder, const CasesWanted& wanted,
                                        const std::function<void(const std::string&)>& warn)
{
    std::vector<std::string> damaged;
    const auto rows = folder.rows(&damaged);
    for (const std::string& what : damaged) {
        warn(what + ": the case is computed again");
    }
    std::vector<std::size_t> cases;
    std::set<std::string> others;
    for (const std::size_t i : wanted.cases) {
        if (!rows[i] || (wanted.retry && rows[i]->failed())) {
            folder.forget(i);
            cases.push_back(i);
        } else if (rows[i]->build != std::string(base::build())) {
            others.insert(rows[i]->build);
        }
    }
    base::failIf(!others.empty() && !cases.empty() && !wanted.anyBuild,
                 "{}: holds cases of build {}, and this is build {}: use that build, or add --any-build (the table "
                 "names the build of each case)",
                 folder.path().native(), fmt::join(others, ", "), std::string(base::build()));
    return cases;
}

SweepTable writeTables(const SweepFolder& folder, const std::vector<std::optional<SweepRow>>& rows)
{
    SweepTable table = tableOf(folder.plan(), rows);
    base::writeWhole(folder.path() / "table.csv", csvText(table));
    writeDatabase(folder.path() / "table.db", table, folder.plan());
    return table;
}

std::vector<std::size_t> casesOfShard(const std::string& shard, std::size_t cases)
{
    const auto [k, n] = partOf(shard);
    // In two steps, so that no product is out of bounds: every part has cases / n, the first ones one more.
    const std::size_t each = cases / n, more = cases % n;
    const std::size_t first = (k - 1) * each + std::min(k - 1, more);
    std::vector<std::size_t> out(each + (k <= more ? 1 : 0));
    std::iota(out.begin(), out.end(), first);
    return out;
}

std::vector<std::size_t> casesOfList(const std::string& list, std::size_t cases)
{
    std::set<std::size_t> out;
    for (const std::string_view text : base::splitAt(',', list)) {
        const auto dash = text.find('-');
        const auto first = base::numberIn<std::size_t>(text.substr(0, dash));
        const auto last = dash == std::string_view::npos ? first : base::numberIn<std::size_t>(text.substr(dash + 1));
        base::failIf(!first || !last || *first > *last, "--cases {}: must be numbers and ranges, as in 0-9,12", list);
        base::failIf(*last >= cases, "--cases {}: the plan has the cases 0 to {}", list, cases - 1);
        std::ranges::copy(std::views::iota(*first, *last + 1), std::inserter(out, out.end()));
    }
    return {out.begin(), out.end()};
}

std::string listOfCases(const std::vector<std::size_t>& sorted)
{
    std::vector<std::string> parts;
    for (std::size_t i = 0; i < sorted.size();) {
        std::size_t last = i;
        while (last + 1 < sorted.size() && sorted[last + 1] == sorted[last] + 1) {
            ++last;
        }
        parts.push_back(last == i ? fmt::format("{}", sorted[i]) : fmt::format("{}-{}", sorted[i], sorted[last]));
        i = last + 1;
    }
    return fmt::format("{}", fmt::join(parts, ","));
}

fs::path shardFolder(const fs::path& folder, const std::string& shard)
{
    const auto [k, n] = partOf(shard);
    return folder / "shards" / fmt::format("{}-of-{}", k, n);
}

fs::path casesFolder(const fs::path& folder, const std::vector<std::size_t>& cases)
{
    std::string name = listOfCases(cases);
    if (name.size() > longestName) {
        const std::size_t hash = std::hash<std::string>{}(name);
        name = fmt::format("{}-and-more-{:016x}", name.substr(0, longestName / 2), hash);
    }
    return folder / "shards" / ("cases-" + name);
}

void copyPlan(const fs::path& from, const fs::path& to)
{
    base::makeFolders(to / "cases");
    for (const char* const file : {"scene.toml", "sweep.json", "plan.toml"}) {
        fs::copy_file(from / file, to / file, fs::copy_options::overwrite_existing);
    }
}

void checkPlanOfParts(const fs::path& folder, const std::string& text, const std::string& given)
{
    std::vector<fs::path> sweeps = partsIn(folder);
    sweeps.push_back(folder);
    for (const fs::path& sweep : sweeps) {
        const auto there = base::contentOf(sweep / "plan.toml");
        base::failIf(there && *there != text, "{}: holds another plan than {}: choose another folder after -o",
                     sweep.native(), given);
    }
}

std::size_t mergeShards(const fs::path& folder, const std::vector<fs::path>& from, bool anyBuild)
{
    std::vector<fs::path> parts = partsIn(folder);
    parts.insert(parts.end(), from.begin(), from.end());
    std::sort(parts.begin(), parts.end());
    base::failIf(parts.empty(), "{}: has no shards to merge: give their folders after --merge", folder.native());
    const bool hasPlan = fs::exists(folder / "plan.toml");
    base::failIf(std::ranges::none_of(parts, hasCases) && !(hasPlan && hasCases(folder)),
                 "{}: no case of its {} is done: run them, and merge again", folder.native(),
                 base::counted(parts.size(), "shard"));
    if (!hasPlan) {
        copyPlan(SweepFolder(parts.front(), "", false).path(), folder);
    }
    const SweepFolder to(folder, "", true);
    to.clean();
    const auto there = to.rows();
    const auto come = rowsToMerge(to, there, parts);
    if (!anyBuild) {
        checkOneBuild(to, there, come);
    }
    for (const auto& [index, merged] : come) {
        copyRecord(merged.shard, to, index);
        to.write(merged.row);
    }
    return come.size();
}

}  // namespace palpate::sweep
