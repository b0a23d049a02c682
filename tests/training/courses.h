#pragma once

#include <training/curriculum.h>

#include <cstdlib>

namespace palpate::training {

/// The data that come along, as they lie in the tree.
inline void useOwnData()
{
    ::setenv("PALPATE_DATA", PALPATE_SOURCE_DIR "/training", 1);
    ::setenv("XDG_DATA_HOME", "/nonexistent", 1);
}

inline Curriculum breastCourse()
{
    useOwnData();
    return findCurriculum("breast-core-biopsy");
}

}  // namespace palpate::training
