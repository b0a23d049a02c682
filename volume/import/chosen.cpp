#include <volume/import/source.h>

#include <base/error.h>

#include <fmt/ranges.h>

#include <array>
#include <optional>

namespace palpate::volume {

namespace {

// The direction that a letter of "LPS" names, in LPS; none for other letters.
std::optional<std::pair<int, double>> directionOf(char letter)
{
    constexpr std::array<const char*, 2> letters = {"LPS", "RAI"};
    for (std::size_t sign = 0; sign < 2; ++sign) {
        for (int axis = 0; axis < 3; ++axis) {
            if (letters[sign][axis] == letter) {
                return std::pair(axis, sign == 0 ? 1.0 : -1.0);
            }
        }
    }
    return std::nullopt;
}

// The axes that `axes` names, as columns in LPS.
Mat3 frameOf(const std::string& axes)
{
    Mat3 frame(0.0);
    std::array<bool, 3> used{};
    bool sound = axes.size() == 3;
    for (std::size_t k = 0; sound && k < 3; ++k) {
        const auto direction = directionOf(axes[k]);
        sound = direction && !used[static_cast<std::size_t>(direction->first)];
        if (sound) {
            used[static_cast<std::size_t>(direction->first)] = true;
            frame[static_cast<int>(k)][direction->first] = direction->second;
        }
    }
    base::failIf(!sound,
                 "--axes {}: must be three letters, one of L R, one of P A, one of S I: the sides of the patient to "
                 "which the axes of the file run, as LPS or RAS",
                 axes);
    return frame;
}

}  // namespace

Index3 checkedVolumes(const std::filesystem::path& file, std::vector<std::int64_t> sizes, Source& source)
{
    if (sizes.size() <= 3) {
        return checkedSize(file, sizes);
    }
    std::uint64_t volumes = 1;
    for (std::size_t i = 3; i < sizes.size(); ++i) {
        refuseIf(sizes[i] < 1 || sizes[i] > 32767 || volumes > 32767, file,
                 "its size is {}: each side must be 1 to 32767, save it again", fmt::join(sizes, " x "));
        volumes *= static_cast<std::uint64_t>(sizes[i]);
    }
    source.dimensions = fmt::format("{}", fmt::join(sizes, " x "));
    sizes.resize(3);
    const Index3 size = checkedSize(file, sizes);
    source.volumes = volumes;
    source.volumeInner = static_cast<std::uint64_t>(sizes[0] * sizes[1] * sizes[2]);
    return size;
}

void chooseVolume(Source& source, const ImportOptions& options)
{
    if (options.volume > 0 && source.layers > 1) {
        std::swap(source.volumes, source.layers);
        source.volumeInner = source.inner;
        source.inner = 1;
        std::erase_if(source.segments,
                      [&](const SegmentName& s) { return s.layer + 1 != static_cast<std::uint64_t>(options.volume); });
    }
    if (static_cast<std::uint64_t>(options.volume) > source.volumes) {
        refuse(source.header, "--volume {}: it holds {}", options.volume,
               source.volumes == 1 ? "one volume" : fmt::format("{} volumes", source.volumes));
    }
    refuseIf(source.volumes > 1 && options.volume == 0, source.header,
             "holds {} volumes, or as many values per voxel ({}): choose one with --volume N, or --image-volume N "
             "where it is the image",
             source.volumes, source.dimensions);
    source.volume = source.volumes > 1 ? static_cast<std::uint64_t>(options.volume) - 1 : 0;
}

void placeAxes(const std::filesystem::path& file, bool oriented, const ImportOptions& options, Affine& affine,
               std::vector<std::string>& warnings)
{
    if (oriented) {
        refuseIf(!options.axes.empty(), file, "--axes {}: it says itself where its axes run: leave --axes out",
                 options.axes);
        return;
    }
    if (options.axes.empty()) {
        warnings.emplace_back(
            "it does not say which side is left: its axes are taken as left, posterior, superior; --axes says otherwise");
        return;
    }
    const Mat3 frame = frameOf(options.axes);
    affine.linear = frame * affine.linear;
    affine.origin = frame * affine.origin;
}

}  // namespace palpate::volume
