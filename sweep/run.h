#pragma once

#include <sweep/folder.h>
#include <sweep/table.h>

#include <functional>
#include <string>
#include <vector>

namespace palpate::sweep {

/// Which cases of a sweep a run is to do.
struct CasesWanted {
    std::vector<std::size_t> cases;  // by number
    bool retry = false;              // those that failed too
    bool anyBuild = false;           // go on with cases of another build
};

/// Those of `wanted` that are still to be run; what is left of them on the disk is forgotten.
/// @param warn  gets a line for each damaged case, which is run again
/// Throws std::runtime_error where the folder holds cases of another build.
std::vector<std::size_t> remainingCases(const SweepFolder& folder, const CasesWanted& wanted,
                                        const std::function<void(const std::string&)>& warn);

/// Writes table.csv and table.db of the rows there are.
SweepTable writeTables(const SweepFolder& folder, const std::vector<std::optional<SweepRow>>& rows);

/// Part K of N, "K/N" with K from 1 to N: a run of neighbouring cases, which share models. Parts differ by one case at
/// most. Throws std::runtime_error for another text.
std::vector<std::size_t> casesOfShard(const std::string& shard, std::size_t cases);
/// "0-9,12": numbers and ranges, both ends included, in any order; a case that is named twice counts once. Throws
/// std::runtime_error for another text and for a case that the plan does not have.
std::vector<std::size_t> casesOfList(const std::string& list, std::size_t cases);
/// The shortest such text.
std::string listOfCases(const std::vector<std::size_t>& sorted);

/// Where part K of N of the sweep in `folder` works: FOLDER/shards/K-of-N, a folder of its own with its own lock.
std::filesystem::path shardFolder(const std::filesystem::path& folder, const std::string& shard);
/// Where a run on some cases works: FOLDER/shards/cases-LIST.
std::filesystem::path casesFolder(const std::filesystem::path& folder, const std::vector<std::size_t>& cases);

/// Makes `to` a folder of the same sweep, without cases.
void copyPlan(const std::filesystem::path& from, const std::filesystem::path& to);

/// Throws std::runtime_error where `folder` or a part of it, FOLDER/shards/*, is of another plan than `text`, which comes
/// from `given`.
void checkPlanOfParts(const std::filesystem::path& folder, const std::string& text, const std::string& given);
/// Takes the rows of the folders `from` and of FOLDER/shards/* into `folder`, which is made where it holds no sweep, and
/// held while this goes on. A case that is done in several places is the same in all; one that failed here and is done
/// there is taken. Throws std::runtime_error where the folders are not of one plan and scene.
/// @returns  how many rows came
std::size_t mergeShards(const std::filesystem::path& folder, const std::vector<std::filesystem::path>& from,
                        bool anyBuild = false);

}  // namespace palpate::sweep
