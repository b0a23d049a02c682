#include <render/ct_picture.h>

#include <base/said.h>
#include <render/overlay.h>
#include <render/screen_image.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>

namespace palpate::render {
namespace {

using base::marked;
using base::tr;

constexpr std::array<const char*, ct::windows.size()> windowNames{marked("soft tissue"), marked("lung"), marked("bone")};

}  // namespace

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

// In a thread of its own: a scan takes longer than a picture of the window may.
void CtPicture::see(const channel::State& state, const channel::Displaced& shape)
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
    *shape_ = shape;
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

void CtPicture::draw(Canvas& canvas, const Area& area, const Area& around, double font, bool exact)
{
    take(exact);
    const bool resized = area.width != area_.width || area.height != area_.height || around.width != around_.width ||
                         around.height != around_.height;
    area_ = area;
    around_ = around;
    if (resized || due_)
        paint();
    due_ = false;
    actor_->SetPosition(around.x, around.y);
    actor_->SetVisibility(1);
    const double x = area.x + 0.5 * font, middle = area.x + 0.5 * area.width;
    if (!scan_) {
        canvas.text({middle, area.y + 0.5 * area.height}, tr("P takes a CT scan"), font, grey, Align::centre);
        return;
    }
    for (std::size_t k = 0; k < scan_->hu.size(); ++k) {
        const Area t = tile(k);
        canvas.text({t.x + 0.4 * font, t.y + 0.4 * font}, fmt::format("z {:.1f} mm", 1e3 * scan_->height[k]), 0.8 * font,
                    grey);
    }
    const Area large = tile(scan_->hu.size() / 2);
    const double high = large.y + 0.5 * large.height;
    canvas.text({large.x + 0.4 * font, high}, tr("R"), font, grey);
    canvas.text({large.x + large.width - 0.4 * font, high}, tr("L"), font, grey, Align::right);
    const double wide = scan_->pixel * scan_->side, bar = 0.05 / wide * large.width;
    canvas.rectangle({large.x + 0.4 * font, large.y + 1.9 * font}, {bar, 3}, grey);
    canvas.text({large.x + 0.4 * font, large.y + 2.2 * font}, "5 cm", 0.8 * font, grey);
    const ct::Window& window = ct::windows[window_];
    canvas.text({x, area.y - lineHeight * font},
                base::said(tr("CT scan {} at {:.1Lf} s; dose so far {:.1Lf} mGy cm; {} ({:.0f} to {:.0f} HU)"), taken_,
                           1e-3 * static_cast<double>(tick_), taken_ * scenery_.ctDoseLength, tr(windowNames[window_]),
                           window.low, window.high),
                font, grey);
}

void CtPicture::hide()
{
    actor_->SetVisibility(0);
    area_ = {};
}

}  // namespace palpate::render
