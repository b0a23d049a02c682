#include <render/ultrasound_picture.h>

#include <base/said.h>

#include <base/units.h>
#include <render/screen_image.h>

#include <base/outputs.h>
#include <render/deformation.h>
#include <render/header.h>
#include <render/overlay.h>
#include <ultrasound/stored_image.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <string_view>
#include <tuple>

namespace palpate::render {
namespace {

using units::mm;
constexpr std::size_t maxCalipers = 4;
constexpr Colour caliperColour{0.2, 0.9, 1.0}, guideColour{0.3, 0.95, 0.4};

const char* nameOf(const ultrasound::Transducer& t)
{
    return t.shape == ultrasound::ProbeShape::curved ? base::tr("curved") : base::tr("linear");
}

}  // namespace

UltrasoundPicture::UltrasoundPicture(vtkRenderer& renderer)
{
    addScreenImage(renderer, image_, actor_);
}

void UltrasoundPicture::open(const channel::Scenery& scenery, std::span<const std::uint8_t> labels,
                             std::span<const std::uint8_t> fine, const std::string& session)
{
    close();
    scenery_ = scenery;
    session_ = session;
    scan_ = std::make_unique<ScanThread>(scenery, labels, fine);
}

void UltrasoundPicture::close()
{
    hide();
    scan_.reset();
    console_.reset();
    drawn_.reset();
    cine_.clear();
    calipers_.clear();
    message_.clear();
    frozen_ = false;
}

void UltrasoundPicture::see(const channel::State& state, const channel::Displaced* shape)
{
    // Also while frozen: a shape that is missed does not come again.
    if (scan_)
        scan_->show(state, shape);
}

ScanThread::Image UltrasoundPicture::shown() const
{
    if (frozen_)
        return cine_.empty() ? nullptr : cine_[cineAt_];
    return scan_ ? scan_->latest() : nullptr;
}

// Null: all black.
void UltrasoundPicture::convert(const ultrasound::BeamImage* image)
{
    if (image_->GetDimensions()[0] != around_.width || image_->GetDimensions()[1] != around_.height) {
        image_->SetDimensions(around_.width, around_.height, 1);
        image_->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
    }
    auto* out = static_cast<std::uint8_t*>(image_->GetScalarPointer());
    const auto across = static_cast<std::size_t>(around_.width), row = static_cast<std::size_t>(area_.width);
    std::fill_n(out, across * static_cast<std::size_t>(around_.height), std::uint8_t{0});
    image_->Modified();
    if (image == nullptr)
        return;
    ultrasound::BeamImage turned = *image;
    turned.mirrored = mirrored_;
    converter_.convert(turned, area_.width, area_.height, pixels_);
    out += static_cast<std::size_t>(area_.y - around_.y) * across + static_cast<std::size_t>(area_.x - around_.x);
    for (int y = 0; y < area_.height; ++y)
        std::memcpy(out + static_cast<std::size_t>(area_.height - 1 - y) * across,
                    &pixels_.grey[static_cast<std::size_t>(y) * row], row);
}

static const char* nothingYet()
{
    return base::tr("no picture yet: nothing was stored");
}

void UltrasoundPicture::draw(Canvas& canvas, const Area& area, const Area& around, double font, bool exact, bool told)
{
    if (!scan_)
        return;
    if (exact && !frozen_)
        scan_->await();
    const bool resized = area != area_ || around != around_;
    area_ = area;
    around_ = around;
    const ScanThread::Image image = shown();
    if (resized || image != drawn_ || mirrored_ != drawnMirrored_) {
        convert(image.get());
        drawn_ = image;
        drawnMirrored_ = mirrored_;
    }
    actor_->SetPosition(around.x, around.y);
    actor_->SetVisibility(1);
    if (!image) {
        const double middle = area.x + 0.5 * area.width, high = area.y + 0.5 * area.height;
        canvas.text({middle, high}, base::tr("ultrasound: preparing the tissue"), font, grey, Align::centre);
        canvas.text({middle, high - lineHeight * font}, message_, font, amber, Align::centre);
        return;
    }
    if (message_ == nothingYet())
        message_.clear();
    if (!told)
        return;
    drawScale(canvas, *image, font);
    drawConsole(canvas, *image, font);
    if (guide_)
        drawGuide(canvas, *image);
    drawCalipers(canvas, *image, font);
}

void UltrasoundPicture::hide()
{
    actor_->SetVisibility(0);
    area_ = {};
}

ultrasound::Layout UltrasoundPicture::layout(const ultrasound::BeamImage& image) const
{
    return {ultrasound::Beam(image.transducer, image.settings), area_.width, area_.height, mirrored_};
}

Point2 UltrasoundPicture::pixel(const ultrasound::BeamImage& image, glm::vec2 at) const
{
    const glm::vec2 p = layout(image).pixel(at.x, at.y);
    return {area_.x + static_cast<double>(p.x), area_.y + area_.height - static_cast<double>(p.y)};
}

// Centimetres at the right, the focus beside them, and the mark of the probe's side.
void UltrasoundPicture::drawScale(Canvas& canvas, const ultrasound::BeamImage& image, double font) const
{
    const ultrasound::Beam beam(image.transducer, image.settings);
    const double half = static_cast<double>(beam.halfWidth() * layout(image).pixelsPerMetre());
    const double middle = area_.x + 0.5 * area_.width,
                 right = std::min(middle + half + 8, area_.x + area_.width - 2.2 * font);
    double written = pixel(image, {0, 0})[1];  // the last number, which a small picture has no room beside
    for (int depth = 0; depth <= static_cast<int>(std::lround(mm * static_cast<double>(image.settings.depth)));
         depth += 5) {
        const double y = pixel(image, {0, 1e-3F * static_cast<float>(depth)})[1];
        const bool whole = depth % 10 == 0;
        canvas.line({right, y}, {right + (whole ? 8.0 : 4.0), y}, 1.5, grey);
        if (whole && depth > 0 && written - y >= font) {
            canvas.text({right + 10, y - 0.35 * font}, fmt::format("{}", depth / 10), 0.85 * font, grey);
            written = y;
        }
    }
    const double focus = pixel(image, {0, image.settings.focus})[1];
    canvas.polygon(std::array<Point2, 3>{{{right - 7, focus + 4}, {right - 7, focus - 4}, {right - 1, focus}}}, amber);
    const double top = area_.y + area_.height - 1.6 * font;
    canvas.text({mirrored_ ? right - 0.2 * font : middle - half - 1.2 * font, top}, "P", 1.2 * font, white, Align::centre,
                true);
}

constexpr double leastMargin = 6;  // for the settings to stand in it [fonts]

// In lines of at most this width; what three blanks separate is apart.
static std::vector<std::string> linesBeside(const Canvas& canvas, const std::string& words, double size, bool bold,
                                            double width)
{
    constexpr std::string_view apart = "   ";
    std::vector<std::string> lines;
    for (std::size_t from = 0, end = 0; end != std::string::npos; from = end + apart.size()) {
        end = words.find(apart, from);
        const auto part = wrapped(canvas, words.substr(from, end - from), size, bold, width);
        lines.insert(lines.end(), part.begin(), part.end());
    }
    return lines;
}

void UltrasoundPicture::drawConsole(Canvas& canvas, const ultrasound::BeamImage& image, double font) const
{
    const ultrasound::Settings& s = image.settings;
    const double x = area_.x + 0.5 * font, row = lineHeight * font;
    double y = area_.y + 0.4 * font;
    const double half =
        static_cast<double>(ultrasound::Beam(image.transducer, s).halfWidth() * layout(image).pixelsPerMetre());
    const double margin = 0.5 * area_.width - half - 1.5 * font;  // left of the picture
    const bool beside = margin > leastMargin * font;
    const auto line = [&](const std::string& what, const Colour& colour, bool bold) {
        const double wide = canvas.widthOf(what, 0.9 * font, bold);
        canvas.cover({x, y}, {wide, 0.9 * font});  // numbers of the scale
        // Speckle is as bright as the words.
        canvas.rectangle({x - 0.4 * font, y - 0.35 * font}, {wide + 0.8 * font, row}, cardColour, 0.75);
        canvas.text({x, y}, what, 0.9 * font, colour, Align::left, bold);
        y += row;
    };
    const auto words = [&](const std::string& all, const Colour& colour, bool bold = false) {
        const auto lines = beside ? linesBeside(canvas, all, 0.9 * font, bold, margin) : std::vector{all};
        for (std::size_t i = lines.size(); i-- > 0;)
            line(shortened(canvas, lines[i], 0.9 * font, bold, area_.width - font), colour, bold);
    };
    std::string sliders;
    for (const float slider : s.tgc)
        sliders += fmt::format(" {:+.0f}", slider);
    words("TGC" + sliders, grey);
    words(base::said(base::tr("gain {:+.0f} dB   range {:.0f} dB"), s.gain, s.dynamicRange), white);
    words(base::said(base::tr("{} {:.1Lf} MHz   {:.0f} mm   focus {:.0f} mm"), nameOf(image.transducer),
                     1e-6 * static_cast<double>(s.frequency), mm * static_cast<double>(s.depth),
                     mm * static_cast<double>(s.focus)),
          white);
    if (frozen_)
        words(base::said(base::tr("FROZEN   {} of {}   {:.2Lf} s"), cineAt_ + 1, cine_.size(),
                         1e-3 * static_cast<double>(image.tick)),
              amber, true);
    if (!message_.empty())
        words(message_, good);
    for (std::size_t i = calipers_.size(); i-- > 0;) {
        const double length = mm * static_cast<double>(glm::distance(calipers_[i][0], calipers_[i][1]));
        words(base::said("{}  {:.1Lf} mm", i + 1, length), caliperColour, true);
    }
}

// Where the needle of this picture goes; before it is inside, the planned line. Only as far as it lies near the picture's
// plane.
void UltrasoundPicture::drawGuide(Canvas& canvas, const ultrasound::BeamImage& image) const
{
    const glm::dvec3 entry = vec(scenery_.entry), aim = vec(scenery_.aim);
    if (!image.needled && entry == aim)
        return;
    const glm::dvec3 from = image.needled ? image.tip : entry;
    constexpr double reach = 80e-3;  // [m]
    const glm::dvec3 to = image.needled ? from + reach * image.axis : aim;
    const ultrasound::Pose& p = image.pose;
    const auto local = [&](glm::dvec3 x) {
        const glm::dvec3 d = x - p.face;
        return glm::dvec3(glm::dot(d, p.lateral), glm::dot(d, p.elevation), glm::dot(d, p.axial));
    };
    const ultrasound::Beam beam(image.transducer, image.settings);
    constexpr int dashes = 40;
    constexpr double thick = 4e-3;  // off the plane [m]
    for (int i = 0; i < dashes; ++i) {
        const glm::dvec3 a = local(from + (to - from) * (i + 0.0) / double{dashes}),
                         b = local(from + (to - from) * (i + 0.5) / double{dashes});
        const glm::vec2 place = beam.place(static_cast<float>(b.x), static_cast<float>(b.z));
        const float limit = 0.5F * (beam.curved() ? beam.transducer().sector : beam.transducer().width);
        if (std::abs(b.y) < thick && place.y > 0 && place.y < image.settings.depth && std::abs(place.x) < limit)
            canvas.line(pixel(image, {a.x, a.z}), pixel(image, {b.x, b.z}), 1.5, guideColour);
    }
}

void UltrasoundPicture::drawCalipers(Canvas& canvas, const ultrasound::BeamImage& image, double font) const
{
    for (std::size_t i = 0; i < calipers_.size(); ++i) {
        const Point2 a = pixel(image, calipers_[i][0]), b = pixel(image, calipers_[i][1]);
        for (const Point2& p : {a, b}) {
            canvas.line({p[0] - 5, p[1]}, {p[0] + 5, p[1]}, 1.5, caliperColour);
            canvas.line({p[0], p[1] - 5}, {p[0], p[1] + 5}, 1.5, caliperColour);
        }
        canvas.line(a, b, 1, caliperColour);
        canvas.text({b[0] + 6, b[1] + 4}, fmt::format("{}", i + 1), 0.9 * font, caliperColour);
    }
}

void UltrasoundPicture::turn(Knob knob, int steps, int slider)
{
    if (!scan_ || frozen_)
        return;
    const auto beginning = scan_->beginning();
    if (!console_ && !beginning)
        return;
    if (!console_)
        console_ = {beginning->transducer, beginning->settings};
    ultrasound::Settings& s = console_->second;
    const auto n = static_cast<float>(steps);
    const bool deep = console_->first.shape == ultrasound::ProbeShape::curved;
    // A step of each knob, with the linear and with the curved probe.
    const std::array<std::tuple<float*, float, float>, 6> knobs{
        {{&s.depth, 5e-3F, 20e-3F},
         {&s.gain, 2.0F, 2.0F},
         {&s.focus, 2e-3F, 10e-3F},
         {&s.frequency, 1e6F, 0.5e6F},
         {&s.dynamicRange, 5.0F, 5.0F},
         {&s.tgc[static_cast<std::size_t>(std::clamp(slider, 0, ultrasound::tgcSliders - 1))], 2.0F, 2.0F}}};
    const auto& [value, shallow, curved] = knobs[static_cast<std::size_t>(knob)];
    *value += n * (deep ? curved : shallow);
    s = ultrasound::within(s, console_->first);
    ask();
}

void UltrasoundPicture::levelTgc()
{
    if (!scan_ || frozen_ || !console_)
        return;
    console_->second.tgc = {};
    ask();
}

void UltrasoundPicture::toggleFreeze()
{
    // Before the first picture there is nothing to hold.
    if (!scan_ || (!frozen_ && scan_->latest() == nullptr))
        return;
    frozen_ = !frozen_;
    cine_ = frozen_ ? scan_->cine() : std::deque<ScanThread::Image>();
    cineAt_ = cine_.empty() ? 0 : cine_.size() - 1;
    calipers_.clear();
}

void UltrasoundPicture::stepCine(int pictures)
{
    if (!frozen_ || cine_.empty())
        return;
    const auto last = static_cast<int>(cine_.size()) - 1;
    cineAt_ = static_cast<std::size_t>(std::clamp(static_cast<int>(cineAt_) + pictures, 0, last));
}

void UltrasoundPicture::changeProbe()
{
    const auto beginning = scan_ ? scan_->beginning() : std::nullopt;
    if (frozen_ || !beginning || beginning->held)
        return;
    const auto shape = console_ ? console_->first.shape : beginning->transducer.shape;
    const auto other = shape == ultrasound::ProbeShape::curved ? ultrasound::linearProbe() : ultrasound::curvedProbe();
    console_ = {other, ultrasound::settingsOf(other)};
    calipers_.clear();
    ask();
}

void UltrasoundPicture::moveProbe(const ultrasound::ProbeMove& move)
{
    if (scan_ && !frozen_)
        scan_->move(move);
}

void UltrasoundPicture::beginCaliper(Point2 pixel)
{
    if (!drawn_)
        return;
    if (calipers_.size() == maxCalipers)
        calipers_.erase(calipers_.begin());
    const glm::vec2 at = layout(*drawn_).point(static_cast<float>(pixel[0] - area_.x),
                                               static_cast<float>(area_.y + area_.height - 1 - pixel[1]));
    calipers_.push_back({at, at});
}

void UltrasoundPicture::dragCaliper(Point2 pixel)
{
    if (!drawn_ || calipers_.empty())
        return;
    calipers_.back()[1] = layout(*drawn_).point(static_cast<float>(pixel[0] - area_.x),
                                                static_cast<float>(area_.y + area_.height - 1 - pixel[1]));
}

// A click measures nothing.
void UltrasoundPicture::endCaliper()
{
    constexpr float least = 0.2e-3F;  // [m]
    if (!calipers_.empty() && glm::distance(calipers_.back()[0], calipers_.back()[1]) < least)
        calipers_.pop_back();
}

// The session and the tick in its name: no picture takes the place of another.
bool UltrasoundPicture::store(const std::filesystem::path& folder)
{
    const ScanThread::Image image = shown();
    if (!image) {
        message_ = nothingYet();
        return false;
    }
    constexpr int width = 800, height = 600;
    ultrasound::BeamImage stored = *image;
    stored.mirrored = mirrored_;
    std::error_code none;  // what cannot be made cannot be written to, which is said below
    std::filesystem::create_directories(folder, none);
    std::filesystem::path file;
    for (int n = 0; file.empty() || std::filesystem::exists(file); ++n)
        file = folder / fmt::format("{}-us-{:07}{}.png", session_, image->tick, n > 0 ? fmt::format("-{}", n) : "");
    try {
        base::writeWhole(file, ultrasound::storedImage(stored, width, height));
        message_ = base::said(base::tr("stored {}"),
                              folder == "." ? file.filename().string() : (folder.filename() / file.filename()).string());
        return true;
    } catch (const std::exception& e) {
        message_ = e.what();
    }
    return false;
}

}  // namespace palpate::render
