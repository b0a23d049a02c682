#pragma once

// Files of a person beside the profiles: what erasing removes.

#include <training/store.h>

#include <filesystem>
#include <set>
#include <string>
#include <vector>

namespace palpate::training {

/// Whose files are looked for, and where.
struct Belongings {
    std::string name;
    std::vector<std::filesystem::path> folders;  // of the store; not only of this person
    std::set<std::filesystem::path> known;       // records that the person's sessions name, anywhere; canonical
    std::set<std::filesystem::path> ofOthers;    // records that sessions of other people name; canonical
    std::set<std::string> otherNames;            // of other people
};

/// Removes from the folders every record that a session of the person names or whose operator the person is, also of
/// sessions that were cut off, with their logs, figures, films and pictures, and the pages of progress that the trainer's
/// window wrote.
Erased removeBelongings(const Belongings& of);

}  // namespace palpate::training
