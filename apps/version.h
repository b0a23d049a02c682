#pragma once

#include <string>

namespace palpate::apps {

/// What `palpate --version` says, without a line's end behind the last: name, version and commit; the compiler; the
/// instruction sets of level elastic, and which this machine runs; the libraries that it was built with.
std::string versionText();

}  // namespace palpate::apps
