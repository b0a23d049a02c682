#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <vector>

// Inside volume/ only: files that may be deflated, whatever their header says.
namespace palpate::volume {

/// True when a gzip or zlib stream begins `offset` bytes into the file.
bool looksPacked(const std::filesystem::path& file, std::uint64_t offset);

/// Feeds the bytes from `offset` on to `sink`, inflated when `packed`, until the end or until `sink` returns false.
/// Throws std::runtime_error for a stream that is cut short or damaged.
void unpack(const std::filesystem::path& file, std::uint64_t offset, bool packed,
            const std::function<bool(std::span<const std::byte>)>& sink);

/// Bytes from `offset` to the end of the file, counted after inflating when `packed`.
std::uint64_t unpackedSize(const std::filesystem::path& file, std::uint64_t offset, bool packed);

/// At most `count` bytes after the first `skip`.
std::vector<std::byte> unpackedBytes(const std::filesystem::path& file, std::uint64_t offset, bool packed,
                                     std::uint64_t skip, std::uint64_t count);

}  // namespace palpate::volume
