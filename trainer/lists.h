#pragma once

#include <nlohmann/json.hpp>

#include <filesystem>
#include <fstream>
#include <optional>
#include <utility>

/// Lists in what commands write. Not part of the interface.
namespace palpate::trainer {

/// Discarded where the file is not JSON.
inline nlohmann::json parsed(const std::filesystem::path& file)
{
    std::ifstream in(file);
    return nlohmann::json::parse(in, nullptr, false);
}

/// Calls `take` for each member of the list under `key`; what is not as it should be is left out.
template <typename Take>
void each(const nlohmann::json& list, const char* key, const Take& take)
{
    if (!list.is_object()) {
        return;
    }
    const auto found = list.find(key);
    if (found == list.end() || !found->is_array()) {
        return;
    }
    for (const nlohmann::json& one : *found) {
        try {
            take(one);
        } catch (const nlohmann::json::exception&) {
            continue;
        }
    }
}

/// Reads members into variables: `read(one, "name", s.name, "session", s.number)`. Throws nlohmann::json::exception.
template <typename Value, typename... More>
void read(const nlohmann::json& object, const char* key, Value& value, More&&... more)
{
    object.at(key).get_to(value);
    if constexpr (sizeof...(more) > 0) {
        read(object, std::forward<More>(more)...);
    }
}

/// Nothing for null and for what is not there.
inline std::optional<double> numberAt(const nlohmann::json& object, const char* key)
{
    const auto found = object.find(key);
    return found != object.end() && found->is_number() ? std::optional(found->get<double>()) : std::nullopt;
}

}  // namespace palpate::trainer
