#include <volume/import/dicom_file.h>

#include <base/error.h>

#include <openjpeg.h>

#include <algorithm>
#include <cstring>

namespace palpate::volume {

namespace {

/// A stream over memory, for OpenJPEG.
struct Memory {
    std::span<const std::byte> bytes;
    std::size_t at = 0;
};

OPJ_SIZE_T readMemory(void* buffer, OPJ_SIZE_T count, void* user)
{
    auto& memory = *static_cast<Memory*>(user);
    const std::size_t there = std::min<std::size_t>(count, memory.bytes.size() - memory.at);
    if (there == 0) {
        return static_cast<OPJ_SIZE_T>(-1);
    }
    std::memcpy(buffer, memory.bytes.data() + memory.at, there);
    memory.at += there;
    return there;
}

OPJ_OFF_T skipMemory(OPJ_OFF_T count, void* user)
{
    auto& memory = *static_cast<Memory*>(user);
    if (count < 0 || static_cast<std::size_t>(count) > memory.bytes.size() - memory.at) {
        return -1;
    }
    memory.at += static_cast<std::size_t>(count);
    return count;
}

OPJ_BOOL seekMemory(OPJ_OFF_T to, void* user)
{
    auto& memory = *static_cast<Memory*>(user);
    if (to < 0 || static_cast<std::size_t>(to) > memory.bytes.size()) {
        return OPJ_FALSE;
    }
    memory.at = static_cast<std::size_t>(to);
    return OPJ_TRUE;
}

template <typename T, void (*destroy)(T*)>
struct Destroy {
    void operator()(T* object) const { destroy(object); }
};
using Stream = std::unique_ptr<opj_stream_t, Destroy<opj_stream_t, opj_stream_destroy>>;
using Image = std::unique_ptr<opj_image_t, Destroy<opj_image_t, opj_image_destroy>>;
struct DestroyCodec {
    void operator()(opj_codec_t* codec) const { opj_destroy_codec(codec); }
};
using Codec = std::unique_ptr<opj_codec_t, DestroyCodec>;

void quiet(const char*, void*) {}

[[noreturn]] void damaged()
{
    throw std::runtime_error("its JPEG 2000 data are damaged: get the file again");
}

}  // namespace

std::vector<std::int32_t> decodeJpeg2000(std::span<const std::byte> bytes, int columns, int rows)
{
    Memory memory{bytes};
    const Stream stream(
        opj_stream_create(std::max<std::size_t>(1024, std::min<std::size_t>(bytes.size(), 1 << 20)), OPJ_TRUE));
    opj_stream_set_read_function(stream.get(), readMemory);
    opj_stream_set_skip_function(stream.get(), skipMemory);
    opj_stream_set_seek_function(stream.get(), seekMemory);
    opj_stream_set_user_data(stream.get(), &memory, nullptr);
    opj_stream_set_user_data_length(stream.get(), bytes.size());
    const bool boxed = bytes.size() > 12 && std::memcmp(bytes.data() + 4, "jP  ", 4) == 0;
    const Codec codec(opj_create_decompress(boxed ? OPJ_CODEC_JP2 : OPJ_CODEC_J2K));
    opj_set_error_handler(codec.get(), quiet, nullptr);
    opj_set_warning_handler(codec.get(), quiet, nullptr);
    opj_set_info_handler(codec.get(), quiet, nullptr);
    opj_dparameters_t parameters;
    opj_set_default_decoder_parameters(&parameters);
    opj_image_t* header = nullptr;
    const bool read = opj_setup_decoder(codec.get(), &parameters) == OPJ_TRUE &&
                      opj_decoder_set_strict_mode(codec.get(), OPJ_TRUE) == OPJ_TRUE &&
                      opj_read_header(stream.get(), codec.get(), &header) == OPJ_TRUE;
    const Image image(header);
    if (!read) {
        damaged();
    }
    // What the stream claims must be what DICOM claims, before it is decoded.
    const auto width = static_cast<OPJ_UINT32>(columns);
    const auto height = static_cast<OPJ_UINT32>(rows);
    base::failIf(image->numcomps != 1 || image->x1 - image->x0 != width || image->y1 - image->y0 != height ||
                     image->comps[0].dx != 1 || image->comps[0].dy != 1,
                 "its JPEG 2000 data are {} x {} pixels of {} values, but the header says {} x {} of 1: get the file again",
                 image->x1 - image->x0, image->y1 - image->y0, image->numcomps, columns, rows);
    if (opj_decode(codec.get(), stream.get(), image.get()) == OPJ_FALSE || image->comps[0].data == nullptr ||
        image->comps[0].w != width || image->comps[0].h != height) {
        damaged();
    }
    return {image->comps[0].data, image->comps[0].data + static_cast<std::size_t>(width) * height};
}

}  // namespace palpate::volume
