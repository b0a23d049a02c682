#pragma once

#include <glm/vec3.hpp>
#include <nlohmann/json.hpp>

namespace nlohmann {

/// Vectors of three in JSON are lists: [x, y, z].
template <typename T, glm::qualifier Q>
struct adl_serializer<glm::vec<3, T, Q>> {
    static void to_json(json& j, const glm::vec<3, T, Q>& v) { j = json::array({v.x, v.y, v.z}); }
    static void from_json(const json& j, glm::vec<3, T, Q>& v)
    {
        v = {j.at(0).get<T>(), j.at(1).get<T>(), j.at(2).get<T>()};
    }
};

}  // namespace nlohmann
