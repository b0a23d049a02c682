#pragma once

#include <string>

namespace palpate::training {

/// Refuses what is no name of a profile: not 1 to 100 bytes of UTF-8 in one line, a blank at an end, '-' at the beginning,
/// and what makes two names look the same: characters that cannot be seen, blanks other than the plain one, accents apart
/// from their letter. Throws std::runtime_error.
void checkProfileName(const std::string& name);

/// Whether two names differ at most in capital and small letters, in any script.
bool isSameButForCase(const std::string& a, const std::string& b);

}  // namespace palpate::training
