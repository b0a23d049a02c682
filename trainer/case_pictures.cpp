#include <trainer/case_pictures.h>

#include <base/inputs.h>

#define STBI_ONLY_PNG
#include <stb/stb_image.h>

#include <cstddef>

namespace palpate::trainer {

Pixels casePicture(const std::string& picture)
{
    const std::string bytes = base::contentOf(picture).value_or("");
    Pixels pixels;
    int channels = 0;
    constexpr std::size_t most = 64U << 20U;  // [bytes]
    if (bytes.empty() || bytes.size() > most) {
        return pixels;
    }
    stbi_uc* const decoded =
        stbi_load_from_memory(reinterpret_cast<const stbi_uc*>(bytes.data()), static_cast<int>(bytes.size()), &pixels.width,
                              &pixels.height, &channels, 3);
    if (decoded == nullptr) {
        return {};
    }
    const auto size = static_cast<std::size_t>(pixels.width) * static_cast<std::size_t>(pixels.height) * 3;
    pixels.rgb.assign(decoded, decoded + size);
    stbi_image_free(decoded);
    return pixels;
}

}  // namespace palpate::trainer
