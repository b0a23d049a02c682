#pragma once

#include <vtkActor2D.h>
#include <vtkCellArray.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkRenderer.h>
#include <vtkSmartPointer.h>
#include <vtkTextActor.h>
#include <vtkUnsignedCharArray.h>

#include <array>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace palpate::render {

using Colour = std::array<double, 3>;
using Point2 = std::array<double, 2>;  // [pixels], from the lower left

enum class Align { left, centre, right };

/// Draws flat shapes and text over the picture, anew in every frame: begin(), what there is to see, end().
class Canvas {
public:
    explicit Canvas(vtkRenderer& renderer);

    void begin();
    void rectangle(Point2 low, Point2 size, const Colour& colour, double opacity = 1);
    void line(Point2 from, Point2 to, double width, const Colour& colour);
    void ring(Point2 centre, double radius, double width, const Colour& colour);
    void polygon(std::span<const Point2> corners, const Colour& colour, double opacity = 1);
    /// `at`: the baseline's left end, middle or right end. `size` in pixels.
    void text(Point2 at, const std::string& words, double size, const Colour& colour, Align align = Align::left,
              bool bold = false);
    void end();
    /// How wide text() draws these words [pixels].
    double widthOf(const std::string& words, double size, bool bold = false) const;

private:
    vtkRenderer& renderer_;
    vtkNew<vtkPoints> points_;
    vtkNew<vtkCellArray> cells_;
    vtkNew<vtkUnsignedCharArray> colours_;
    vtkNew<vtkPolyData> shapes_;
    std::vector<vtkSmartPointer<vtkTextActor>> texts_;
    std::size_t used_ = 0;
    mutable std::map<std::pair<std::string, int>, double> widths_;  // of words already measured
};

}  // namespace palpate::render
