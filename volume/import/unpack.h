#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <vector>

// Inside volume/import/ only: streams of voxels, however they are packed.
namespace palpate::volume {

/// How the bytes of the voxels are written. `text`: numbers between white space, which come out as doubles of this machine.
enum class Encoding : std::uint8_t { raw, deflate, bzip2, text, hex };

/// What the stream at `offset` begins like: raw, unless a gzip, zlib or bzip2 stream begins there.
Encoding looksLike(const std::filesystem::path& file, std::uint64_t offset);

/// Feeds the bytes from `offset` on to `sink`, decoded, until the end or until `sink` returns false.
/// Throws std::runtime_error for a stream that is cut short or damaged.
void unpack(const std::filesystem::path& file, std::uint64_t offset, Encoding encoding,
            const std::function<bool(std::span<const std::byte>)>& sink);

/// How many bytes there are from `offset` to the end of the file, counted after decoding, but no more than just over
/// `most`.
std::uint64_t unpackedSize(const std::filesystem::path& file, std::uint64_t offset, Encoding encoding, std::uint64_t most);

/// At most `count` bytes of a file after the first `skip`, counted after decoding.
std::vector<std::byte> unpackedBytes(const std::filesystem::path& file, Encoding encoding, std::uint64_t skip,
                                     std::uint64_t count);

}  // namespace palpate::volume
