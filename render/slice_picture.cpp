#include <render/slice_picture.h>

#include <render/screen_image.h>

#include <channel/needle_shape.h>
#include <render/tool_picture.h>
#include <render/volume_picture.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace palpate::render {
namespace {

constexpr Colour pureWhite{1, 1, 1}, farTool{0.16, 0.55, 0.65};
using Pixel = std::array<std::uint8_t, 3>;
constexpr Pixel airPixel{12, 13, 18};

Pixel pixelOf(const std::array<float, 3>& colour)
{
    return {byteOf(colour[0]), byteOf(colour[1]), byteOf(colour[2])};
}

// What a tissue is drawn with: its own part, and how much of the image's grey comes to it.
struct Paint {
    std::array<float, 3> own{};
    float grey = 0;
    Pattern pattern = Pattern::none;

    Pixel over(float image) const
    {
        const auto mixed = [&](std::size_t k) { return static_cast<std::uint8_t>(own[k] + grey * image + 0.5F); };
        return {mixed(0), mixed(1), mixed(2)};
    }
};

// Tissues that are opaque in the 3-D view, such as vessels and tumours, tint the image more than fat does.
std::array<Paint, channel::maxTissues> paintsOf(const Anatomy& anatomy)
{
    constexpr float least = 0.16F, most = 0.6F;
    std::array<Paint, channel::maxTissues> paints{};
    for (std::size_t t = 0; t < paints.size(); ++t) {
        const channel::TissueLook& tissue = anatomy.scenery.tissue[t];
        const float opacity = std::clamp(tissue.opacity, 0.0F, 1.0F);
        const float colour = t == 0 || !anatomy.imageShown()     ? 1
                             : anatomy.look == SliceLook::tinted ? least + (most - least) * opacity
                                                                 : 0;
        const Pixel pixel = t == 0 ? airPixel : pixelOf(tissue.colour);
        for (std::size_t k = 0; k < 3; ++k)
            paints[t].own[k] = colour * pixel[k];
        paints[t].grey = 1 - colour;
        paints[t].pattern = t == 0 || colour == 0 ? Pattern::none : patternOf(anatomy.palette, tissue.name);
    }
    return paints;
}

// Of a pattern: darker, or lighter where the colour is dark.
Pixel shaded(Pixel plain)
{
    const bool dark = 3 * plain[0] + 6 * plain[1] + plain[2] < 10 * 90;
    for (std::uint8_t& part : plain)
        part = static_cast<std::uint8_t>(dark ? 255 - (255 - part) * 3 / 5 : part * 2 / 5);
    return plain;
}

// Outside the labels there is the image alone.
Pixel outside(float image)
{
    const auto grey = static_cast<std::uint8_t>(image + 0.5F);
    return {std::max(airPixel[0], grey), std::max(airPixel[1], grey), std::max(airPixel[2], grey)};
}

// Of what is not in the plane.
Colour farOf(const Colour& colour)
{
    return {0.5 * colour[0], 0.5 * colour[1], 0.5 * colour[2]};
}

double pixelsPerMetre(const ViewFrame& frame, const Area& area)
{
    return std::min(area.width, area.height) / frame.extent;
}

// The part of a segment that lies in the area (Liang-Barsky), or nothing.
std::optional<std::pair<Point2, Point2>> clipped(Point2 a, Point2 b, const Area& area)
{
    double from = 0, to = 1;
    const std::array<double, 2> low{static_cast<double>(area.x), static_cast<double>(area.y)};
    const std::array<double, 2> high{low[0] + area.width, low[1] + area.height};
    for (std::size_t k = 0; k < 2; ++k) {
        const double d = b[k] - a[k];
        if (d == 0 && (a[k] < low[k] || a[k] > high[k]))
            return std::nullopt;
        if (d == 0)
            continue;
        const double t0 = (low[k] - a[k]) / d, t1 = (high[k] - a[k]) / d;
        from = std::max(from, std::min(t0, t1));
        to = std::min(to, std::max(t0, t1));
    }
    if (from >= to)
        return std::nullopt;
    const auto at = [&](double t) { return Point2{a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])}; };
    return std::pair(at(from), at(to));
}

}  // namespace

SlicePicture::SlicePicture(vtkRenderer& renderer)
{
    addScreenImage(renderer, image_, actor_);
}

bool SlicePicture::update(const Anatomy& anatomy, const ViewFrame& frame, const Area& area, const VoxelBox& changed,
                          int step)
{
    const bool resized = area.width != area_.width || area.height != area_.height;
    // Turns and shifts too small for a pixel are not worth a new picture.
    const double turn = glm::distance(frame.centre, frame_.centre) +
                        glm::distance(frame.right, frame_.right) * frame.extent +
                        glm::distance(frame.up, frame_.up) * frame.extent;
    const bool turned = turn * pixelsPerMetre(frame, area) > 1.0;
    const bool other = anatomy.look != look_ || anatomy.grey.window() != window_;
    area_ = area;
    actor_->SetPosition(area.x, area.y);
    actor_->SetVisibility(1);
    const bool all = resized || turned || other || step_ != step;
    if (!all && changed.empty())
        return false;
    if (all)
        frame_ = frame;
    step_ = step;
    look_ = anatomy.look;
    window_ = anatomy.grey.window();
    if (resized) {
        image_->SetDimensions(area.width, area.height, 1);
        image_->AllocateScalars(VTK_UNSIGNED_CHAR, 3);
    }
    due_ = all ? VoxelBox{} : changed;
    image_->Modified();
    return true;
}

void SlicePicture::paint(const Anatomy& anatomy)
{
    if (!due_)
        return;
    const Deformation& deformation = anatomy.deformation;
    const std::array<Paint, channel::maxTissues> paints = paintsOf(anatomy);
    const bool grey = anatomy.imageShown(), shells = !grey || anatomy.look != SliceLook::image;
    const Pixel shell = pixelOf(shellColour);
    auto* pixels = static_cast<Pixel*>(image_->GetScalarPointer());
    const double metres = 1 / pixelsPerMetre(frame_, area_);
    const channel::Grid& grid = deformation.grid();
    const VoxelBox box = *std::exchange(due_, std::nullopt);
    const bool all = box.empty();
    const int step = step_;
    const glm::dvec3 low = vec(grid.origin) + grid.spacing * glm::dvec3(box.low),
                     high = vec(grid.origin) + grid.spacing * glm::dvec3(box.high);
    for (int row = 0; row < area_.height; row += step) {
        glm::vec3 shift(0);
        for (int column = 0; column < area_.width; column += step) {
            const glm::dvec3 p = frame_.centre + frame_.right * ((column + 0.5 * step - 0.5 * area_.width) * metres) +
                                 frame_.up * ((row + 0.5 * step - 0.5 * area_.height) * metres);
            if (!all && (glm::any(glm::lessThan(p, low)) || glm::any(glm::greaterThan(p, high))))
                continue;
            const glm::dvec3 rest = deformation.rest(p, shift);
            const std::uint8_t label = deformation.restLabel(rest);
            const std::size_t tissue = label & channel::rowBits;
            const bool onShell = shells && tissue != 0 && (label & channel::shellBit) != 0;
            const float image = grey ? anatomy.grey.at(rest) : 0.0F;
            const Pixel plain = tissue == 0 ? outside(image) : paints[tissue].over(image);
            const Pixel pixel = onShell ? shell : isMarked(paints[tissue].pattern, column, row) ? shaded(plain) : plain;
            for (int y = row; y < std::min(row + step, area_.height); ++y)
                std::fill_n(pixels + static_cast<std::ptrdiff_t>(y) * area_.width + column,
                            std::min(step, area_.width - column), pixel);
        }
    }
}

void SlicePicture::hide()
{
    actor_->SetVisibility(0);
    step_ = 0;
    area_ = {};
}

bool SlicePicture::isAway(glm::dvec3 p) const
{
    constexpr double inPlane = 2e-3;  // [m]
    return std::abs(glm::dot(p - frame_.centre, frame_.towards)) > inPlane;
}

Point2 SlicePicture::pixel(glm::dvec3 p) const
{
    const glm::dvec3 d = (p - frame_.centre) * pixelsPerMetre(frame_, area_);
    return {area_.x + 0.5 * area_.width + glm::dot(d, frame_.right), area_.y + 0.5 * area_.height + glm::dot(d, frame_.up)};
}

std::vector<Point2> stickOutline(Point2 from, Point2 to, double radius)
{
    constexpr int pieces = 24;  // of half a circle
    constexpr double halfTurn = std::numbers::pi;
    const double first = std::atan2(to[1] - from[1], to[0] - from[0]) + 0.5 * halfTurn;
    std::vector<Point2> corners;
    for (int i = 0; i <= 2 * pieces + 1; ++i) {
        const Point2 end = i <= pieces ? from : to;
        const double angle = first + halfTurn * (i <= pieces ? i : i - 1) / pieces;
        corners.push_back({end[0] + radius * std::cos(angle), end[1] + radius * std::sin(angle)});
    }
    return corners;
}

void SlicePicture::drawFingertip(Canvas& canvas, Point2 from, Point2 to, double radius, bool away) const
{
    const std::vector<Point2> corners = stickOutline(from, to, radius);
    const double width = away ? 1.5 : 3;
    const Colour& colour = away ? farTool : toolColour;
    for (const bool border : {true, false})
        for (std::size_t i = 0; i < corners.size(); ++i)
            if (const auto part = clipped(corners[i], corners[(i + 1) % corners.size()], area_))
                canvas.line(part->first, part->second, width + (border ? 2 : 0), border ? Colour{0, 0, 0} : colour);
}

void SlicePicture::drawTool(Canvas& canvas, const channel::Scenery& scenery, const channel::State& state) const
{
    constexpr Colour outline{0, 0, 0};
    const glm::dvec3 tip = vec(state.tip);
    const double width = std::max(3.0, 2 * scenery.toolRadius * pixelsPerMetre(frame_, area_));
    if (scenery.tool == channel::ToolKind::sphere) {
        if (area_.holds(pixel(tip))) {
            canvas.ring(pixel(tip), width / 2 + 1.5, 1.5, outline);
            canvas.ring(pixel(tip), width / 2, isAway(tip) ? 1.5 : 3, isAway(tip) ? farTool : toolColour);
        }
        return;
    }
    const channel::NeedleShape shape = needleShape(scenery, state);
    if (scenery.tool == channel::ToolKind::capsule)
        return drawFingertip(canvas, pixel(shape.front()), pixel(shape.back()), width / 2, isAway(tip));
    for (const bool border : {true, false})
        for (std::size_t i = 0; i + 1 < shape.size(); ++i) {
            const auto part = clipped(pixel(shape[i]), pixel(shape[i + 1]), area_);
            const bool away = isAway(0.5 * (shape[i] + shape[i + 1]));
            if (part && border)
                canvas.line(part->first, part->second, (away ? 0.6 : 1.0) * width + 2, outline);
            else if (part)
                canvas.line(part->first, part->second, (away ? 0.6 : 1.0) * width, away ? farTool : toolColour);
        }
    if (area_.holds(pixel(tip)))
        canvas.ring(pixel(tip), width / 2 + 2, 2, pureWhite);
}

void SlicePicture::annotate(Canvas& canvas, const Anatomy& anatomy, const channel::State& state, glm::dvec3 aim,
                            double font) const
{
    const channel::Scenery& scenery = anatomy.scenery;
    const glm::dvec3 entry = vec(scenery.entry);
    const bool planned = entry != vec(scenery.aim);
    constexpr int dashes = 10;
    for (int i = 0; i < dashes && planned; ++i) {
        const double a = static_cast<double>(i) / dashes, b = a + 0.5 / dashes;
        const glm::dvec3 from = glm::mix(entry, aim, a), to = glm::mix(entry, aim, b);
        if (const auto dash = clipped(pixel(from), pixel(to), area_)) {
            const bool away = isAway(0.5 * (from + to));
            canvas.line(dash->first, dash->second, (away ? 0.24 : 0.36) * font, {0, 0, 0});
            canvas.line(dash->first, dash->second, (away ? 0.1 : 0.18) * font, away ? farOf(planColour) : planColour);
        }
    }
    if (planned && area_.holds(pixel(aim))) {
        const bool away = isAway(aim);
        canvas.ring(pixel(aim), 0.55 * font, (away ? 0.24 : 0.36) * font, {0, 0, 0});
        canvas.ring(pixel(aim), 0.55 * font, (away ? 0.1 : 0.18) * font, away ? farOf(planColour) : planColour);
    }
    for (std::size_t i = 0; i < std::min<std::size_t>(state.holes, channel::maxHoles); ++i) {
        const auto seen = [&](const std::array<float, 3>& p) {
            return anatomy.deformation.seen(glm::dvec3(p[0], p[1], p[2]));
        };
        const glm::dvec3 from = seen(state.hole[i].from), to = seen(state.hole[i].to);
        if (const auto core = clipped(pixel(from), pixel(to), area_)) {
            const bool away = isAway(0.5 * (from + to));
            canvas.line(core->first, core->second, (away ? 0.3 : 0.6) * font, {0, 0, 0});
            canvas.line(core->first, core->second, (away ? 0.15 : 0.4) * font, away ? farOf(coreColour) : coreColour);
        }
    }
    drawMarks(canvas, scenery, state, font);
    drawTool(canvas, scenery, state);
}

// Those near the slice.
void SlicePicture::drawMarks(Canvas& canvas, const channel::Scenery& scenery, const channel::State& state,
                             double font) const
{
    constexpr double near = 5e-3;  // [m]
    for (std::size_t i = 0; i < std::min<std::size_t>(state.marks, channel::maxMarks); ++i) {
        const glm::dvec3 place = markedPlace(scenery, state.mark[i]);
        if (std::abs(glm::dot(place - frame_.centre, frame_.towards)) > near || !area_.holds(pixel(place)))
            continue;
        canvas.ring(pixel(place), 0.4 * font, 0.36 * font, {0, 0, 0});
        canvas.ring(pixel(place), 0.4 * font, 0.2 * font, markColour);
    }
}

void SlicePicture::label(Canvas& canvas, const GreyImage* grey, double font, double below) const
{
    constexpr double narrow = 6.5, low = 5.5;  // in fonts
    if (area_.width < narrow * font || area_.height < low * font)
        return;
    const double left = area_.x, bottom = area_.y, right = left + area_.width, top = bottom + area_.height;
    const double middleX = (left + right) / 2, middleY = (bottom + top) / 2;
    const double highest = std::min(top, below) - 1.5 * font;
    const auto letter = [&](Point2 at, const std::string& words) {
        if (at[1] > highest)
            return;
        canvas.rectangle({at[0] - 0.8 * font, at[1] - 2}, {1.6 * font, 1.3 * font}, {0, 0, 0}, 0.55);
        canvas.text(at, words, font, pureWhite, Align::centre, true);
    };
    letter({right - font, middleY}, side(frame_.right));
    letter({left + font, middleY}, side(-frame_.right));
    if (const double y = std::min(top - 2.0 * font, highest); y > middleY + 1.3 * font)
        letter({left + 0.8 * area_.width, y}, side(frame_.up));  // beside the tool
    letter({middleX, bottom + 4}, side(-frame_.up));
    // In a narrow slice scale bar and grey window stand above the letter, one above the other.
    const double bar = 0.01 * pixelsPerMetre(frame_, area_), wide = std::max(bar, 3.2 * font) + font;
    double y = bottom + (0.5 * font + wide < 0.5 * area_.width - font ? 0 : 1.6 * font);
    if (y + 1.9 * font < std::min(middleY - 2, below)) {
        canvas.rectangle({left + 0.5 * font, y + 2}, {wide, 1.9 * font}, {0, 0, 0}, 0.55);
        canvas.rectangle({left + font, y + 0.35 * font}, {bar, 3}, pureWhite);
        canvas.text({left + font, y + 0.6 * font}, "10 mm", 0.9 * font, pureWhite);
        y += 2 * font;
    }
    if (grey != nullptr)
        drawWindow(canvas, *grey, font, y, std::min(middleY - 2, below));
}

// In the lower right corner where there is room beside the letter in the middle, else `above` what is there.
void SlicePicture::drawWindow(Canvas& canvas, const GreyImage& grey, double font, double above, double below) const
{
    const std::string name = grey.windowName(), range = grey.windowRange();
    const double right = area_.x + area_.width, size = 0.9 * font;
    const double wide = std::max(canvas.widthOf(name, size), canvas.widthOf(range, size)) + font;
    const bool beside = wide + 0.2 * font < 0.5 * area_.width - font;
    const double low = beside ? area_.y : above;
    if (low + 2.5 * font + 2 > below || wide + 0.4 * font > area_.width)
        return;
    canvas.rectangle({right - wide - 0.2 * font, low + 2}, {wide, 2.5 * font}, {0, 0, 0}, 0.55);
    canvas.text({right - 0.7 * font, low + 1.5 * font}, name, size, pureWhite, Align::right);
    canvas.text({right - 0.7 * font, low + 0.4 * font}, range, size, pureWhite, Align::right);
}

}  // namespace palpate::render
