#include <volume/unpack.h>

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <stdexcept>

namespace palpate::volume {

namespace {

std::ifstream openAt(const std::filesystem::path& file, std::uint64_t offset)
{
    std::ifstream in(file, std::ios::binary);
    if (!in) {
        throw std::runtime_error(fmt::format("{}: cannot be opened: check the name and the permissions", file.string()));
    }
    in.seekg(static_cast<std::streamoff>(offset));
    return in;
}

// zlib's inflater; 47 makes it accept gzip and zlib streams.
class Inflater {
public:
    Inflater()
    {
        if (inflateInit2(&stream_, 47) != Z_OK) {
            throw std::runtime_error("zlib cannot start: out of memory");
        }
    }
    ~Inflater() { inflateEnd(&stream_); }
    Inflater(const Inflater&) = delete;
    Inflater& operator=(const Inflater&) = delete;

    z_stream& stream() { return stream_; }

private:
    z_stream stream_{};
};

constexpr std::size_t chunk = std::size_t{1} << 18;

std::size_t fill(std::ifstream& in, std::vector<std::byte>& buffer)
{
    in.read(reinterpret_cast<char*>(buffer.data()), static_cast<std::streamsize>(buffer.size()));
    return static_cast<std::size_t>(in.gcount());
}

void inflateAll(const std::filesystem::path& file, std::ifstream& in,
                const std::function<bool(std::span<const std::byte>)>& sink)
{
    Inflater inflater;
    z_stream& z = inflater.stream();
    std::vector<std::byte> packed(chunk);
    std::vector<std::byte> plain(4 * chunk);
    bool ended = false;
    while (const std::size_t count = fill(in, packed)) {
        z.next_in = reinterpret_cast<Bytef*>(packed.data());
        z.avail_in = static_cast<uInt>(count);
        while (z.avail_in > 0) {
            // A gzip file may hold several members, one after another; anything else behind the end is padding.
            if (ended && (*z.next_in != 0x1f || inflateReset(&z) != Z_OK)) {
                return;
            }
            z.next_out = reinterpret_cast<Bytef*>(plain.data());
            z.avail_out = static_cast<uInt>(plain.size());
            const int status = inflate(&z, Z_NO_FLUSH);
            if (status != Z_OK && status != Z_STREAM_END && status != Z_BUF_ERROR) {
                throw std::runtime_error(fmt::format("{}: its compressed data are damaged ({}): get the file again",
                                                     file.string(), z.msg != nullptr ? z.msg : "zlib error"));
            }
            ended = status == Z_STREAM_END;
            if (!sink({plain.data(), plain.size() - z.avail_out})) {
                return;
            }
        }
    }
    if (!ended) {
        throw std::runtime_error(
            fmt::format("{}: its compressed data end too early: the file is cut short, get it again", file.string()));
    }
}

}  // namespace

bool looksPacked(const std::filesystem::path& file, std::uint64_t offset)
{
    std::ifstream in = openAt(file, offset);
    std::array<unsigned char, 2> magic{};
    in.read(reinterpret_cast<char*>(magic.data()), 2);
    const bool gzip = magic[0] == 0x1f && magic[1] == 0x8b;
    const bool zlib = magic[0] == 0x78 && (magic[0] * 256 + magic[1]) % 31 == 0;
    return in && (gzip || zlib);
}

void unpack(const std::filesystem::path& file, std::uint64_t offset, bool packed,
            const std::function<bool(std::span<const std::byte>)>& sink)
{
    std::ifstream in = openAt(file, offset);
    if (packed) {
        inflateAll(file, in, sink);
        return;
    }
    std::vector<std::byte> buffer(chunk);
    while (const std::size_t count = fill(in, buffer)) {
        if (!sink({buffer.data(), count})) {
            return;
        }
    }
}

std::uint64_t unpackedSize(const std::filesystem::path& file, std::uint64_t offset, bool packed)
{
    if (!packed) {
        const std::uint64_t size = std::filesystem::file_size(file);
        return size > offset ? size - offset : 0;
    }
    std::uint64_t size = 0;
    unpack(file, offset, packed, [&](std::span<const std::byte> bytes) {
        size += bytes.size();
        return true;
    });
    return size;
}

std::vector<std::byte> unpackedBytes(const std::filesystem::path& file, std::uint64_t offset, bool packed,
                                     std::uint64_t skip, std::uint64_t count)
{
    std::vector<std::byte> out;
    unpack(file, offset, packed, [&](std::span<const std::byte> bytes) {
        const std::uint64_t over = std::min<std::uint64_t>(skip, bytes.size());
        skip -= over;
        const auto rest = bytes.subspan(over);
        const auto wanted = rest.first(std::min<std::uint64_t>(rest.size(), count - out.size()));
        out.insert(out.end(), wanted.begin(), wanted.end());
        return out.size() < count;
    });
    return out;
}

}  // namespace palpate::volume
