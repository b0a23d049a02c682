#include <ultrasound/display.h>

#include <algorithm>
#include <cmath>

namespace palpate::ultrasound {

namespace {

void bar(Pixels& p, float x, float y, int width, int height, std::uint8_t grey)
{
    const int left = static_cast<int>(std::lround(x)), top = static_cast<int>(std::lround(y));
    for (int j = std::max(top, 0); j < std::min(top + height, p.height); ++j)
        for (int i = std::max(left, 0); i < std::min(left + width, p.width); ++i)
            p.grey[static_cast<std::size_t>(j) * static_cast<std::size_t>(p.width) + static_cast<std::size_t>(i)] = grey;
}

}  // namespace

Layout::Layout(const Beam& beam, int width, int height, bool mirrored, Margins margins)
    : scale_(std::min(static_cast<float>(std::max(height - 2 * margins.above, 1)) / (beam.settings().depth - beam.top()),
                      static_cast<float>(std::max(width - 2 * margins.beside, 1)) / (2 * beam.halfWidth()))),
      middle_(0.5F * static_cast<float>(width)),
      above_(static_cast<float>(margins.above)),
      top_(beam.top()),
      left_(mirrored ? -1.0F : 1.0F)
{
}

glm::vec2 Layout::pixel(float lateral, float axial) const noexcept
{
    return {middle_ - left_ * lateral * scale_, above_ + (axial - top_) * scale_};
}

glm::vec2 Layout::point(float column, float row) const noexcept
{
    return {left_ * (middle_ - column - 0.5F) / scale_, (row + 0.5F - above_) / scale_ + top_};
}

void ScanConverter::makeTable(const Beam& beam, const Layout& layout)
{
    const Settings& s = beam.settings();
    table_.assign(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), {});
    std::size_t to = 0;
    for (int v = 0; v < height_; ++v)
        for (int u = 0; u < width_; ++u, ++to) {
            const glm::vec2 p = layout.point(static_cast<float>(u), static_cast<float>(v));
            const glm::vec2 at = beam.place(p.x, p.y);
            const float i = at.x / beam.pitch() + 0.5F * static_cast<float>(s.lines - 1), k = at.y / beam.sample() - 0.5F;
            if (!(i >= 0 && k >= 0 && i < static_cast<float>(s.lines - 1) && k < static_cast<float>(s.samples - 1)))
                continue;
            const auto part = [](float f) { return static_cast<std::uint8_t>(256 * (f - std::floor(f))); };
            table_[to] = {static_cast<int>(k) * s.lines + static_cast<int>(i), part(i), part(k)};
        }
}

void ScanConverter::convert(const BeamImage& image, int width, int height, Pixels& out)
{
    Settings of = image.settings;
    of.gain = of.dynamicRange = of.frequency = of.focus = 0;
    of.tgc = {};
    if (of != of_ || image.transducer.shape != shape_ || image.mirrored != mirrored_ || width != width_ ||
        height != height_) {
        of_ = of;
        shape_ = image.transducer.shape;
        mirrored_ = image.mirrored;
        width_ = width;
        height_ = height;
        const Beam beam(image.transducer, image.settings);
        makeTable(beam, Layout(beam, width, height, image.mirrored, margins_));
    }
    out.width = width;
    out.height = height;
    out.grey.resize(table_.size());
    const auto lines = static_cast<std::size_t>(image.settings.lines);
    for (std::size_t q = 0; q < table_.size(); ++q) {
        const Source& s = table_[q];
        if (s.at < 0) {
            out.grey[q] = 0;
            continue;
        }
        const std::uint8_t* g = &image.grey[static_cast<std::size_t>(s.at)];
        const int upper = g[0] * (256 - s.line) + g[1] * s.line, lower = g[lines] * (256 - s.line) + g[lines + 1] * s.line;
        out.grey[q] = static_cast<std::uint8_t>((upper * (256 - s.sample) + lower * s.sample) >> 16);
    }
}

void drawMarks(const BeamImage& image, Pixels& pixels)
{
    const Beam beam(image.transducer, image.settings);
    const Layout layout(beam, pixels.width, pixels.height, image.mirrored);
    constexpr std::uint8_t tick = 180, mark = 220;
    const float half = layout.pixelsPerMetre() * beam.halfWidth(), middle = 0.5F * static_cast<float>(pixels.width);
    const float right = middle + half + 10;
    const int deepest = static_cast<int>(std::lround(1e3F * image.settings.depth));
    for (int mm = 0; mm <= deepest; mm += 5)
        bar(pixels, right, layout.pixel(0, 1e-3F * static_cast<float>(mm)).y, mm % 10 == 0 ? 12 : 6, 2, tick);
    bar(pixels, right + 16, layout.pixel(0, image.settings.focus).y - 3, 6, 7, mark);
    bar(pixels, image.mirrored ? middle + half + 9 : middle - half - 18, Margins().above + 2, 9, 9, mark);
}

}  // namespace palpate::ultrasound
