#include <render/ct_picture.h>

#include <base/said.h>
#include <render/overlay.h>
#include <render/screen_image.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>

namespace palpate::render {
using base::marked;
using base::tr;

constexpr std::array<const char*, ct::windows.size()> windowNames{marked("soft tissue"), marked("lung"), marked("bone")};

CtPicture::CtPicture(vtkRenderer& renderer)
{
    addScreenImage(renderer, image_, actor_);
}

void CtPicture::open(const channel::Scenery& scenery, std::span<const std::uint8_t> labels,
                     std::span<const std::uint16_t> image)
{
    close();
    scenery_ = scenery;
    body_ = std::make_unique<channel::Deformation>(scenery, labels);
    shape_ = std::make_unique<channel::Displaced>();
    scanner_.emplace(scenery, image);
}

void CtPicture::close()
{
    hide();
    take(true);
    scanner_.reset();
    body_.reset();
    scan_.reset();
    taken_ = 0;
    due_ = true;
}

// A scan that is ready.
void CtPicture::take(bool wait)
{
    if (!coming_.valid() || (!wait && coming_.wait_for(std::chrono::seconds(0)) != std::future_status::ready))
        return;
    scan_ = coming_.get();
    due_ = true;
}

void CtPicture::see(const channel::State& state, const channel::Displaced& shape, const Recorded* recorded)
{
    const auto taken = recorded != nullptr ? recorded->takenAt(state.tick) : nullptr;
    if (taken)
        scan(taken->state, taken->shape);
    else
        scan(state, {shape.nodes.data(), shape.count});
}

// In a thread of its own: a scan takes longer than a picture of the window may.
void CtPicture::scan(const channel::State& state, std::span<const channel::Displacement> shape)
{
    if (!scanner_ || state.pictures == taken_)
        return;
    take(true);
    taken_ = state.pictures;
    tick_ = state.tick;
    if (taken_ == 0) {
        scan_.reset();  // of a record that was taken back to its beginning
        due_ = true;
        return;
    }
    shape_->count = static_cast<std::uint32_t>(shape.size());
    std::ranges::copy(shape, shape_->nodes.begin());
    coming_ = std::async(std::launch::async, [this, state] {
        body_->apply(*shape_);
        return scanner_->scan(state, *body_);
    });
}

void CtPicture::nextWindow() noexcept
{
    window_ = (window_ + 1) % ct::windows.size();
    due_ = true;
}

// The middle slice as large as there is room for beside a column of the others.
Area CtPicture::tile(std::size_t slice) const
{
    const std::size_t count = scan_->hu.size(), middle = count / 2;
    const auto others = static_cast<int>(count) - 1;
    const int beside = others > 0 ? area_.height / std::max(others, 2) : 0;
    const int large = std::min(area_.height, area_.width - std::min(beside, area_.width / 3));
    if (slice == middle)
        return {area_.x, area_.y + area_.height - large, large, large};
    const int small = std::max(1, std::min(beside, area_.width - large));
    const auto place = static_cast<int>(slice < middle ? slice : slice - 1);  // the feet at the bottom
    return {area_.x + large, area_.y + place * small, small, small};
}

void CtPicture::paint()
{
    image_->SetDimensions(around_.width, around_.height, 1);
    image_->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
    auto* out = static_cast<std::uint8_t*>(image_->GetScalarPointer());
    const auto across = static_cast<std::size_t>(around_.width);
    std::fill_n(out, across * static_cast<std::size_t>(around_.height), std::uint8_t{0});
    image_->Modified();
    for (std::size_t k = 0; scan_ && k < scan_->hu.size(); ++k) {
        const Area t = tile(k);
        const std::vector<std::uint8_t> picture = ct::shown(*scan_, k, ct::windows[window_], t.width);
        const auto row = static_cast<std::size_t>(t.width);
        for (int y = 0; y < t.height; ++y)
            std::memcpy(out + static_cast<std::size_t>(t.y - around_.y + t.height - 1 - y) * across +
                            static_cast<std::size_t>(t.x - around_.x),
                        &picture[static_cast<std::size_t>(y) * row], row);
    }
}

// What the scan is and the dose so far, in as many lines as the width makes of it.
std::vector<std::string> CtPicture::caption(const Canvas& canvas, double wide, double font) const
{
    const ct::Window& window = ct::windows[window_];
    const std::string scan = coming_.valid()
                                 ? tr("CT scan is being computed")
                                 : base::said(tr("CT scan {} at {:.1Lf} s"), taken_, 1e-3 * static_cast<double>(tick_));
    const std::string all = base::said(tr("{}; dose so far {:.1Lf} mGy cm; {} ({:.0f} to {:.0f} HU)"), scan,
                                       taken_ * scenery_.ctDoseLength, tr(windowNames[window_]), window.low, window.high);
    std::vector<std::string> lines;
    for (std::size_t from = 0, end = 0; end != std::string::npos; from = end + 2) {
        end = all.find("; ", from);
        const std::string part = all.substr(from, end - from);
        const std::string longer = lines.empty() ? part : lines.back() + "; " + part;
        if (lines.empty() || canvas.widthOf(longer, font) > wide)
            lines.push_back(part);
        else
            lines.back() = longer;
    }
    return lines;
}

// On tissue of any brightness.
void CtPicture::label(Canvas& canvas, Point2 at, const std::string& words, double size, Align align)
{
    const double wide = canvas.widthOf(words, size, true), left = align == Align::right ? at[0] - wide : at[0];
    canvas.rectangle({left - 0.3 * size, at[1] - 2}, {wide + 0.6 * size, 1.3 * size}, {0, 0, 0}, 0.55);
    canvas.text(at, words, size, white, align, true);
}

constexpr double leastLabelled = 6, leastScaled = 12;  // widths of a scan [fonts]

void CtPicture::drawLabels(Canvas& canvas, double font) const
{
    for (std::size_t k = 0; k < scan_->hu.size(); ++k) {
        const Area t = tile(k);
        // A label that would hide most of its scan is left out.
        if (t.width < leastLabelled * font)
            continue;
        label(canvas, {t.x + 0.4 * font, t.y + 0.4 * font}, base::said("z {:.1Lf} mm", 1e3 * scan_->height[k]), 0.8 * font);
    }
    const Area large = tile(scan_->hu.size() / 2);
    if (large.width < leastScaled * font)
        return;
    const double high = large.y + 0.5 * large.height;
    label(canvas, {large.x + 0.4 * font, high}, tr("R"), font);
    label(canvas, {large.x + large.width - 0.4 * font, high}, tr("L"), font, Align::right);
    const double wide = scan_->pixel * scan_->side, bar = 0.05 / wide * large.width;
    canvas.rectangle({large.x + 0.16 * font, large.y + 1.6 * font}, {std::max(bar, 2.2 * font) + 0.48 * font, 1.8 * font},
                     {0, 0, 0}, 0.55);
    canvas.rectangle({large.x + 0.4 * font, large.y + 1.9 * font}, {bar, 3}, white);
    canvas.text({large.x + 0.4 * font, large.y + 2.3 * font}, "5 cm", 0.8 * font, white, Align::left, true);
}

// Of a scan that has no picture yet.
const char* CtPicture::whyEmpty(bool handIsHere) const
{
    return coming_.valid() ? tr("CT scan is being computed") : handIsHere ? tr("P takes a CT scan") : tr("no CT scan yet");
}

void CtPicture::draw(Canvas& canvas, const Area& area, const Area& around, double font, const CtLook& look)
{
    take(look.exact);
    const double x = area.x + 0.5 * font, row = lineHeight * font;
    const std::vector<std::string> words = scan_ ? caption(canvas, area.width - font, font) : std::vector<std::string>();
    // The caption has the lower edge of the area to itself.
    Area pictures = area;
    pictures.y += static_cast<int>(row * static_cast<double>(words.size()));
    pictures.height = std::max(1, area.height + area.y - pictures.y);
    const bool resized = pictures != area_ || around != around_;
    area_ = pictures;
    around_ = around;
    if (resized || due_)
        paint();
    due_ = false;
    actor_->SetPosition(around.x, around.y);
    actor_->SetVisibility(1);
    if (!scan_) {
        canvas.text({area.x + 0.5 * area.width, area.y + 0.5 * area.height}, whyEmpty(look.handIsHere), font, grey,
                    Align::centre);
        return;
    }
    drawLabels(canvas, font);
    for (std::size_t line = 0; line < words.size(); ++line)
        canvas.text({x, area.y + row * (static_cast<double>(words.size() - line) - 0.85)}, words[line], font, grey);
}

void CtPicture::hide()
{
    actor_->SetVisibility(0);
    area_ = {};
}

}  // namespace palpate::render
