#pragma once

#include <studies/accuracy/accuracy.h>
#include <studies/accuracy/reference_file.h>

#include <nlohmann/json.hpp>

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace palpate::studies {

/// One method at one setting in one scene against one law: a line of cases.jsonl and an entry of chart[]. With errors of
/// all looks (near_pct, ..), of the press and of the drag (press, drag: the same keys), or with the reason of its failure.
/// @param result  nothing when it failed
nlohmann::json accuracyEntry(const std::string& scene, const std::string& law, const Baseline& method,
                             const AccuracyRun& run, const TrialResult* result);

/// The error of the linear law itself against `law`, an entry of floors[].
nlohmann::json floorEntry(const std::string& scene, const std::string& law, std::span<const TrialErrors> looks);
/// An entry of references[].
nlohmann::json referenceEntry(const ReferenceInfo& info);

/// Marks which entries of `figures["chart"]` lie on the front of their scene and law: on_front.
void markFronts(nlohmann::json& figures);

/// For people: per scene and law the front, and where level elastic is beaten between 20 us and 10 ms.
void printAccuracy(const nlohmann::json& figures);

/// One line per entry of chart[], a head line first.
std::string accuracyCsv(const nlohmann::json& figures);

/// Writes accuracy.json, accuracy.csv, one PNG per scene and law, and accuracy.html. Throws std::runtime_error.
/// @returns  the pictures
std::vector<std::filesystem::path> writeAccuracyFolder(const std::filesystem::path& folder, const nlohmann::json& figures);

/// The finished cases of a run, one JSON text per line: what a run that was stopped has done already. Lines of other
/// builds, of other references, or that are cut short count for nothing and stay.
class AccuracyLog {
public:
    /// @param file   "" = nothing is kept
    /// @param build  of this program
    /// Throws std::runtime_error when the file is there and cannot be read.
    AccuracyLog(std::filesystem::path file, std::string build);

    /// The entry of a case that is done, or null. `reference`: its key.
    const nlohmann::json* find(const std::string& reference, const std::string& method, const std::string& setting) const;
    /// Appends at once, so that whatever ends the program loses no case. Throws std::runtime_error.
    void add(const std::string& reference, const nlohmann::json& entry);

private:
    std::filesystem::path file_;
    std::string build_;
    std::vector<nlohmann::json> lines_;  // of this build
};

}  // namespace palpate::studies
