#pragma once

#include <glm/vec4.hpp>

// Inside channel/ only.
namespace palpate::channel {

/// Four floats that are added and multiplied at once.
using Lanes = float __attribute__((vector_size(16)));

inline Lanes lanes(const glm::vec4& v) noexcept
{
    return Lanes{v.x, v.y, v.z, v.w};
}

}  // namespace palpate::channel
