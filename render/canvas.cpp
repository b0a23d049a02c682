#include <render/canvas.h>

#include <base/utf8.h>

#include <vtkCellData.h>
#include <vtkPolyDataMapper2D.h>
#include <vtkProperty2D.h>
#include <vtkTextProperty.h>
#include <vtkTextRenderer.h>

#include <algorithm>
#include <cmath>

namespace palpate::render {
namespace {

// Images, shapes and text lie on each other in this order.
constexpr int shapeLayer = 1, textLayer = 2;

unsigned char byte(double value)
{
    return static_cast<unsigned char>(std::lround(255 * std::clamp(value, 0.0, 1.0)));
}

constexpr int screenDpi = 72;  // of all text actors: a font's size is in pixels

void dress(vtkTextProperty& look, double size, const Colour& colour, bool bold)
{
    look.SetFontFamilyToArial();
    look.SetFontSize(static_cast<int>(std::lround(size)));
    look.SetColor(colour[0], colour[1], colour[2]);
    look.SetBold(bold ? 1 : 0);
}

}  // namespace

Canvas::Canvas(vtkRenderer& renderer) : renderer_(renderer)
{
    colours_->SetNumberOfComponents(4);
    vtkNew<vtkPolyDataMapper2D> mapper;
    mapper->SetInputData(shapes_);
    vtkNew<vtkActor2D> actor;
    actor->SetMapper(mapper);
    actor->SetLayerNumber(shapeLayer);
    renderer_.AddActor2D(actor);
}

void Canvas::begin()
{
    points_->Reset();
    cells_->Reset();
    colours_->Reset();
    put_.clear();
    used_ = 0;
}

void Canvas::polygon(std::span<const Point2> corners, const Colour& colour, double opacity)
{
    cells_->InsertNextCell(static_cast<int>(corners.size()));
    for (const Point2& p : corners)
        cells_->InsertCellPoint(points_->InsertNextPoint(p[0], p[1], 0));
    const std::array<unsigned char, 4> rgba{byte(colour[0]), byte(colour[1]), byte(colour[2]), byte(opacity)};
    colours_->InsertNextTypedTuple(rgba.data());
}

void Canvas::rectangle(Point2 low, Point2 size, const Colour& colour, double opacity)
{
    const std::array<Point2, 4> corners{
        {low, {low[0] + size[0], low[1]}, {low[0] + size[0], low[1] + size[1]}, {low[0], low[1] + size[1]}}};
    polygon(corners, colour, opacity);
}

void Canvas::rectangle(const Area& area, const Colour& colour, double opacity)
{
    const auto number = [](int n) { return static_cast<double>(n); };
    rectangle({number(area.x), number(area.y)}, {number(area.width), number(area.height)}, colour, opacity);
}

void Canvas::line(Point2 from, Point2 to, double width, const Colour& colour)
{
    const double dx = to[0] - from[0], dy = to[1] - from[1], length = std::hypot(dx, dy);
    if (!(length > 0))
        return;
    const double nx = -dy / length * width / 2, ny = dx / length * width / 2;
    const std::array<Point2, 4> corners{
        {{from[0] + nx, from[1] + ny}, {from[0] - nx, from[1] - ny}, {to[0] - nx, to[1] - ny}, {to[0] + nx, to[1] + ny}}};
    polygon(corners, colour);
}

void Canvas::ring(Point2 centre, double radius, double width, const Colour& colour)
{
    constexpr int sides = 24;
    const double turn = 2 * std::acos(-1.0) / sides;
    for (int i = 0; i < sides; ++i)
        line({centre[0] + radius * std::cos(i * turn), centre[1] + radius * std::sin(i * turn)},
             {centre[0] + radius * std::cos((i + 1) * turn), centre[1] + radius * std::sin((i + 1) * turn)}, width, colour);
}

void Canvas::text(Point2 at, const std::string& words, double size, const Colour& colour, Align align, bool bold)
{
    if (used_ == texts_.size()) {
        texts_.push_back(vtkSmartPointer<vtkTextActor>::New());
        texts_.back()->SetLayerNumber(textLayer);
        texts_.back()->SetTextScaleModeToNone();
        renderer_.AddActor2D(texts_.back());
    }
    vtkTextActor& actor = *texts_[used_++];
    actor.SetVisibility(1);
    actor.SetInput(words.c_str());
    actor.SetDisplayPosition(static_cast<int>(std::lround(at[0])), static_cast<int>(std::lround(at[1])));
    vtkTextProperty& look = *actor.GetTextProperty();
    dress(look, size, colour, bold);
    introduce(size, colour, bold);
    look.SetVerticalJustificationToBottom();
    look.SetJustification(align == Align::left     ? VTK_TEXT_LEFT
                          : align == Align::centre ? VTK_TEXT_CENTERED
                                                   : VTK_TEXT_RIGHT);
    put_.push_back({words, at, size, align, bold});
}

// VTK keeps the faces of thirty looks (a look is font, size and colour), and for each the object that was first drawn with
// it, to load the face again. Actors are used again for other words: the face of a bold look would come back thin, or the
// other way round, in those letters that had not been drawn before. So the first object with a look is one that stays.
void Canvas::introduce(double size, const Colour& colour, bool bold)
{
    if (!looks_.emplace(bold, std::lround(size), colour).second)
        return;
    vtkNew<vtkTextProperty> look;
    dress(*look, size, colour, bold);
    std::array<int, 4> box{};
    if (vtkTextRenderer* const renderer = vtkTextRenderer::GetInstance())
        renderer->GetBoundingBox(look, "x", box.data(), screenDpi);
}

double Canvas::leftOf(const Put& put) const
{
    if (put.align == Align::left)
        return put.at[0];
    const double wide = widthOf(put.words, put.size, put.bold);
    return put.at[0] - (put.align == Align::centre ? wide / 2 : wide);
}

double Canvas::widest(std::span<const std::string> lines, double size, bool bold) const
{
    double wide = 0;
    for (const std::string& line : lines)
        wide = std::max(wide, widthOf(line, size, bold));
    return wide;
}

std::vector<Written> Canvas::written() const
{
    std::vector<Written> all;
    for (const Put& p : put_) {
        if (p.covered)
            continue;
        const double left = leftOf(p);
        all.push_back({p.words, {left, p.at[1]}, {left + widthOf(p.words, p.size, p.bold), p.at[1] + p.size}});
    }
    return all;
}

// Words are measured last: most lie elsewhere anyway.
void Canvas::cover(Point2 low, Point2 size)
{
    const Point2 high{low[0] + size[0], low[1] + size[1]};
    for (std::size_t i = 0; i < put_.size(); ++i) {
        Put& p = put_[i];
        if (p.covered || p.at[1] >= high[1] || p.at[1] + p.size <= low[1] ||
            (p.align == Align::left && p.at[0] >= high[0]) || (p.align == Align::right && p.at[0] <= low[0]))
            continue;
        const double left = leftOf(p);
        p.covered = left < high[0] && left + widthOf(p.words, p.size, p.bold) > low[0];
        if (p.covered)
            texts_[i]->SetVisibility(0);
    }
}

double Canvas::widthOf(const std::string& words, double size, bool bold) const
{
    constexpr std::size_t most = 4096;
    const int pixels = static_cast<int>(std::lround(size));
    const auto key = std::make_pair(words, bold ? -pixels : pixels);
    if (const auto known = widths_.find(key); known != widths_.end())
        return known->second;
    if (widths_.size() > most)
        widths_.clear();
    vtkNew<vtkTextProperty> look;
    dress(*look, size, {}, bold);
    std::array<int, 4> box{};
    vtkTextRenderer* const renderer = vtkTextRenderer::GetInstance();
    const bool measured = renderer != nullptr && renderer->GetBoundingBox(look, words, box.data(), screenDpi);
    const double width = measured ? box[1] - box[0] + 1 : 0.6 * size * static_cast<double>(words.size());
    return widths_[key] = width;
}

void Canvas::end()
{
    for (std::size_t i = used_; i < texts_.size(); ++i)
        texts_[i]->SetVisibility(0);
    shapes_->SetPoints(points_);
    shapes_->SetPolys(cells_);
    shapes_->GetCellData()->SetScalars(colours_);
    points_->Modified();
    cells_->Modified();
    colours_->Modified();
    shapes_->Modified();
}

std::string shortened(const Canvas& canvas, const std::string& words, double size, bool bold, double width)
{
    if (words.empty() || canvas.widthOf(words, size, bold) <= width)
        return words;
    const std::string ellipsis = "...";
    std::string kept = words;
    do {
        while (kept.size() > 1 && !base::beginsCharacter(kept.back()))
            kept.pop_back();
        kept.pop_back();
        while (!kept.empty() && kept.back() == ' ')
            kept.pop_back();
    } while (!kept.empty() && canvas.widthOf(kept + ellipsis, size, bold) > width);
    return kept.empty() ? kept : kept + ellipsis;
}

}  // namespace palpate::render
