#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

namespace palpate::base {

/// 64-bit FNV-1a over plain data, byte by byte: tells contents apart, protects against nobody.
/// Source: G. Fowler, L. C. Noll, K.-P. Vo, D. Eastlake, "The FNV Non-Cryptographic Hash Algorithm", IETF draft.
struct Fnv {
    std::uint64_t value = 0xcbf29ce484222325;

    template <typename T>
    void addAll(std::span<const T> data) noexcept
    {
        static_assert(std::is_trivially_copyable_v<T>);
        for (const std::byte b : std::as_bytes(data)) {
            value = (value ^ static_cast<std::uint64_t>(b)) * 0x100000001b3;
        }
    }
    template <typename T>
    void addAll(const std::vector<T>& data) noexcept
    {
        addAll(std::span<const T>(data));
    }
    /// A struct with padding would add bytes that mean nothing.
    template <typename T>
    void add(const T& one) noexcept
    {
        addAll(std::span<const T>(&one, 1));
    }
    /// The length too, so that two texts in a row do not run together.
    void addText(std::string_view text) noexcept
    {
        add(text.size());
        addAll(std::span<const char>(text));
    }
};

}  // namespace palpate::base
