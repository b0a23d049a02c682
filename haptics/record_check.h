#pragma once

#include <haptics/recorder.h>

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::haptics {

/// What there is to say of a record before its figures are believed.
struct RecordCheck {
    Seal seal;
    std::vector<std::string> warnings;  // one line each, without the file's name; empty: nothing
};

/// Whether a record is as it was closed, whether all its ticks follow one another, whether what it says at its end and of
/// its scene agrees with them, and whether it is of this build. Reads the file twice, and computes no forces: that is what
/// replay() does. Throws std::runtime_error for a file that is no record.
/// @param build  this program's, see base::build()
RecordCheck checkRecord(const Record& record, std::string_view build);

/// Why what is computed from a record's poses differs from what it says: "the record was made by another build (X) or
/// machine, or was changed". Another build only where it was one; where the seal is broken, that it was changed alone.
/// Opens the file anew: whoever asks may just be reading it.
/// @param build  this program's, see base::build()
std::string whyItDiffers(const std::filesystem::path& file, std::string_view build);

/// The first `most` of `parts`, separated by semicolons, and how many more there are.
std::string someOf(const std::vector<std::string>& parts, std::size_t most = 4);

}  // namespace palpate::haptics
