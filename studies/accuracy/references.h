#pragma once

#include <studies/accuracy/accuracy.h>
#include <studies/accuracy/reference_file.h>

#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace palpate::studies {

/// Where solved references lie.
struct ReferenceFolders {
    std::filesystem::path own;                  // new ones are written here
    std::vector<std::filesystem::path> others;  // that come with the program
};
/// @param own  "" = `references` of base::UserFolder::cache
ReferenceFolders referenceFolders(const std::filesystem::path& own);

using SolvedReference = std::pair<Reference, ReferenceInfo>;

/// The reference of a subject and law ("linear", "neo-hookean"): any file NAME-KEY.ref of the folders, or, when there is
/// none, what palpate-reference solves now (minutes). The first reference of a subject may press the same body up to a
/// millimetre and ten degrees beside the scene's entry; the subject's path becomes its path, and all others must have the
/// same. Throws std::runtime_error when palpate-reference was not built, or fails.
/// @param what  the subject as the command line names it
/// @param tell  is told before a solution begins, and of another path
SolvedReference solvedReference(const std::string& what, AccuracySubject& subject, const std::string& law,
                                const ReferenceFolders& folders, const std::function<void(const std::string&)>& tell);

/// Another program of ours: beside this one, in libexec/palpate of the installation, or in PATH; "" where it is in none.
/// @param name  of the file
std::filesystem::path ourProgram(const std::string& name);
/// palpate-reference, likewise; "" when it was not built.
std::filesystem::path referenceProgram();
/// Runs it with its output on standard error, and waits. Returns its exit status; -1 when it was killed.
int runReferenceProgram(const std::vector<std::string>& arguments);

}  // namespace palpate::studies
