#include <volume/import/unpack.h>

#include <base/error.h>

#include <bzlib.h>
#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <fstream>
#include <limits>
#include <string>
#include <string_view>

namespace palpate::volume {

namespace {

using Sink = std::function<bool(std::span<const std::byte>)>;

constexpr std::size_t chunk = std::size_t{1} << 18;

std::ifstream openAt(const std::filesystem::path& file, std::uint64_t offset)
{
    std::ifstream in(file, std::ios::binary);
    base::failIf(!in, "{}: cannot be opened: check the name and the permissions", file.native());
    in.seekg(static_cast<std::streamoff>(offset));
    return in;
}

std::size_t fill(std::ifstream& in, std::vector<std::byte>& buffer)
{
    in.read(reinterpret_cast<char*>(buffer.data()), static_cast<std::streamsize>(buffer.size()));
    return static_cast<std::size_t>(in.gcount());
}

[[noreturn]] void damaged(const std::filesystem::path& file, const std::string& why)
{
    throw base::error("{}: its compressed data are damaged ({}): get the file again", file.string(), why);
}

// zlib's inflater; 47 makes it accept gzip and zlib streams.
class Inflater {
public:
    Inflater() { base::failIf(inflateInit2(&stream_, 47) != Z_OK, "zlib cannot start: out of memory"); }
    ~Inflater() { inflateEnd(&stream_); }
    Inflater& operator=(Inflater&&) = delete;

    void take(std::span<std::byte> packed)
    {
        stream_.next_in = reinterpret_cast<Bytef*>(packed.data());
        stream_.avail_in = static_cast<uInt>(packed.size());
    }
    std::size_t left() const { return stream_.avail_in; }
    /// Goes on with a further member of a gzip file; false where none begins.
    bool restart() { return *stream_.next_in == 0x1f && inflateReset(&stream_) == Z_OK; }
    /// Returns what remains free of `plain`.
    std::size_t decode(const std::filesystem::path& file, std::span<std::byte> plain, bool& ended)
    {
        stream_.next_out = reinterpret_cast<Bytef*>(plain.data());
        stream_.avail_out = static_cast<uInt>(plain.size());
        const int status = inflate(&stream_, Z_NO_FLUSH);
        if (status != Z_OK && status != Z_STREAM_END && status != Z_BUF_ERROR) {
            damaged(file, stream_.msg != nullptr ? stream_.msg : "zlib error");
        }
        ended = status == Z_STREAM_END;
        return stream_.avail_out;
    }

private:
    z_stream stream_{};
};

class Bunzipper {
public:
    Bunzipper() { start(); }
    ~Bunzipper() { BZ2_bzDecompressEnd(&stream_); }
    Bunzipper& operator=(Bunzipper&&) = delete;

    void take(std::span<std::byte> packed)
    {
        stream_.next_in = reinterpret_cast<char*>(packed.data());
        stream_.avail_in = static_cast<unsigned>(packed.size());
    }
    std::size_t left() const { return stream_.avail_in; }
    /// Goes on with a further stream; false where none begins.
    bool restart()
    {
        if (*stream_.next_in != 'B') {
            return false;
        }
        BZ2_bzDecompressEnd(&stream_);
        const bz_stream rest = stream_;
        stream_ = {};
        start();
        stream_.next_in = rest.next_in;
        stream_.avail_in = rest.avail_in;
        return true;
    }
    std::size_t decode(const std::filesystem::path& file, std::span<std::byte> plain, bool& ended)
    {
        stream_.next_out = reinterpret_cast<char*>(plain.data());
        stream_.avail_out = static_cast<unsigned>(plain.size());
        const int status = BZ2_bzDecompress(&stream_);
        if (status != BZ_OK && status != BZ_STREAM_END) {
            damaged(file, fmt::format("bzip2 error {}", status));
        }
        ended = status == BZ_STREAM_END;
        return stream_.avail_out;
    }

private:
    void start() { base::failIf(BZ2_bzDecompressInit(&stream_, 0, 0) != BZ_OK, "bzip2 cannot start: out of memory"); }
    bz_stream stream_{};
};

template <class Decoder>
void decodeAll(const std::filesystem::path& file, std::ifstream& in, const Sink& sink)
{
    Decoder decoder;
    std::vector<std::byte> packed(chunk), plain(4 * chunk);
    bool ended = false;
    while (const std::size_t count = fill(in, packed)) {
        decoder.take({packed.data(), count});
        std::size_t room = 1;
        // A full buffer may mean that there is more to come of what is read already.
        while (decoder.left() > 0 || (room == 0 && !ended)) {
            // A file may hold several streams, one after another; anything else behind the end is padding.
            if (ended && !decoder.restart()) {
                return;
            }
            room = decoder.decode(file, plain, ended);
            if (!sink({plain.data(), plain.size() - room})) {
                return;
            }
        }
    }
    base::failIf(!ended, "{}: its compressed data end too early: the file is cut short, get it again", file.native());
}

// One number of a text; NaN is one, a word is not.
double number(const std::filesystem::path& file, const std::string& token)
{
    double value = 0;
    const char* first = token.data() + (token[0] == '+' ? 1 : 0);
    const auto [end, error] = std::from_chars(first, token.data() + token.size(), value);
    if (error == std::errc::result_out_of_range) {
        return std::numeric_limits<double>::infinity();
    }
    if (error != std::errc() || end != token.data() + token.size()) {
        throw base::error("{}: its voxels are text, but '{}' is no number: save it again with gzip encoding", file.string(),
                          token.substr(0, 20));
    }
    return value;
}

bool isSpace(char c)
{
    return c == ' ' || c == '\n' || c == '\r' || c == '\t' || c == ',' || c == '\f' || c == '\v';
}

// Part by part what `use(bytes)` makes of it. False where the sink has had enough.
template <class Use>
bool readParts(std::ifstream& in, const Sink& sink, Use&& use)
{
    std::vector<std::byte> buffer(chunk);
    while (const std::size_t count = fill(in, buffer)) {
        if (!sink(use(std::span<const std::byte>(buffer).first(count)))) {
            return false;
        }
    }
    return true;
}

void readText(const std::filesystem::path& file, std::ifstream& in, const Sink& sink)
{
    constexpr std::size_t longest = 400;  // no number is longer
    std::vector<double> numbers;
    std::string token;
    const auto take = [&](std::span<const std::byte> bytes) {
        numbers.clear();
        for (const std::byte b : bytes) {
            const char c = static_cast<char>(b);
            if (!isSpace(c) && token.size() < longest) {
                token += c;
            } else if (!token.empty()) {
                numbers.push_back(number(file, token));
                token.clear();
            }
        }
        return std::as_bytes(std::span(numbers));
    };
    if (readParts(in, sink, take)) {
        sink(take(std::as_bytes(std::span("\n", 1))));  // the last number ends with the file
    }
}

int hexDigit(char c)
{
    const auto at = std::string_view("0123456789abcdefABCDEF").find(c);
    return at == std::string_view::npos ? -1 : static_cast<int>(at < 16 ? at : at - 6);
}

void readHex(const std::filesystem::path& file, std::ifstream& in, const Sink& sink)
{
    std::vector<std::byte> bytes;
    int high = -1;
    readParts(in, sink, [&](std::span<const std::byte> digits) {
        bytes.clear();
        for (const std::byte b : digits) {
            const char c = static_cast<char>(b);
            if (isSpace(c)) {
                continue;
            }
            const int digit = hexDigit(c);
            base::failIf(digit < 0,
                         "{}: its voxels are hexadecimal digits, but there is a character with code {} among them: save "
                         "it again with gzip encoding",
                         file.native(), static_cast<int>(static_cast<unsigned char>(c)));
            if (high < 0) {
                high = digit;
            } else {
                bytes.push_back(static_cast<std::byte>(16 * high + digit));
                high = -1;
            }
        }
        return std::span<const std::byte>(bytes);
    });
}

}  // namespace

Encoding looksLike(const std::filesystem::path& file, std::uint64_t offset)
{
    std::ifstream in = openAt(file, offset);
    std::array<unsigned char, 10> magic{};
    in.read(reinterpret_cast<char*>(magic.data()), magic.size());
    const auto there = in.gcount();
    const bool gzip = magic[0] == 0x1f && magic[1] == 0x8b;
    const bool zlib = magic[0] == 0x78 && (magic[0] * 256 + magic[1]) % 31 == 0;
    if (there >= 2 && (gzip || zlib)) {
        return Encoding::deflate;
    }
    constexpr std::array<unsigned char, 6> block = {0x31, 0x41, 0x59, 0x26, 0x53, 0x59};  // begins each of bzip2's blocks
    const bool bzip2 =
        std::memcmp(magic.data(), "BZh", 3) == 0 && std::equal(block.begin(), block.end(), magic.begin() + 4);
    return there == 10 && bzip2 ? Encoding::bzip2 : Encoding::raw;
}

void unpack(const std::filesystem::path& file, std::uint64_t offset, Encoding encoding, const Sink& sink)
{
    std::ifstream in = openAt(file, offset);
    switch (encoding) {
        case Encoding::deflate:
            return decodeAll<Inflater>(file, in, sink);
        case Encoding::bzip2:
            return decodeAll<Bunzipper>(file, in, sink);
        case Encoding::text:
            return readText(file, in, sink);
        case Encoding::hex:
            return readHex(file, in, sink);
        case Encoding::raw:
            readParts(in, sink, std::identity());
    }
}

std::uint64_t unpackedSize(const std::filesystem::path& file, std::uint64_t offset, Encoding encoding, std::uint64_t most)
{
    if (encoding == Encoding::raw) {
        const std::uint64_t size = std::filesystem::file_size(file);
        return size > offset ? size - offset : 0;
    }
    std::uint64_t size = 0;
    unpack(file, offset, encoding, [&](std::span<const std::byte> bytes) {
        size += bytes.size();
        return size <= most;
    });
    return size;
}

std::vector<std::byte> unpackedBytes(const std::filesystem::path& file, Encoding encoding, std::uint64_t skip,
                                     std::uint64_t count)
{
    std::vector<std::byte> out;
    unpack(file, 0, encoding, [&](std::span<const std::byte> bytes) {
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
