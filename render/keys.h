#pragma once

#include <string>

namespace palpate::render {

/// What keys and mouse do in each kind of window: a line each. The key ? shows those of the window in it.
std::string keysInWords();

}  // namespace palpate::render
