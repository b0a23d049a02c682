#pragma once

#include <utility>
#include <vector>

namespace palpate::python {

/// (qualified name, text) of all that palpate/_palpate.pyi explains.
const std::vector<std::pair<const char*, const char*>>& docs();

}  // namespace palpate::python
