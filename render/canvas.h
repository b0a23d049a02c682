#pragma once

#include <render/screen_plan.h>

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
#include <set>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace palpate::render {

using Colour = std::array<double, 3>;
using Point2 = std::array<double, 2>;  // [pixels], from the lower left

/// Words that a canvas has written, and where their box is [pixels].
struct Written {
    std::string words;
    Point2 low, high;
};

enum class Align { left, centre, right };

/// Draws flat shapes and text over the picture, anew in every frame: begin(), what there is to see, end().
class Canvas {
public:
    explicit Canvas(vtkRenderer& renderer);

    void begin();
    void rectangle(Point2 low, Point2 size, const Colour& colour, double opacity = 1);
    void rectangle(const Area& area, const Colour& colour, double opacity = 1);
    void line(Point2 from, Point2 to, double width, const Colour& colour);
    void ring(Point2 centre, double radius, double width, const Colour& colour);
    void polygon(std::span<const Point2> corners, const Colour& colour, double opacity = 1);
    /// `at`: the baseline's left end, middle or right end. `size` in pixels.
    void text(Point2 at, const std::string& words, double size, const Colour& colour, Align align = Align::left,
              bool bold = false);
    /// Takes away the words that lie in this rectangle, or partly in it: a card that comes over them would not hide them,
    /// since all words lie on all shapes.
    void cover(Point2 low, Point2 size);
    void end();
    /// How wide text() draws these words [pixels].
    double widthOf(const std::string& words, double size, bool bold = false) const;
    /// All words since begin(), in their order.
    std::vector<Written> written() const;
    /// The width of the widest of these lines.
    double widest(std::span<const std::string> lines, double size, bool bold = false) const;

private:
    // Words of text(), which are measured only where somebody asks.
    struct Put {
        std::string words;
        Point2 at;
        double size;
        Align align;
        bool bold;
        bool covered = false;
    };
    // Where a text's box begins [pixels].
    double leftOf(const Put& put) const;
    void introduce(double size, const Colour& colour, bool bold);

    vtkRenderer& renderer_;
    vtkNew<vtkPoints> points_;
    vtkNew<vtkCellArray> cells_;
    vtkNew<vtkUnsignedCharArray> colours_;
    vtkNew<vtkPolyData> shapes_;
    std::vector<vtkSmartPointer<vtkTextActor>> texts_;
    std::vector<Put> put_;
    std::size_t used_ = 0;
    std::set<std::tuple<bool, long, Colour>> looks_;                // that text() has drawn: bold, size, colour
    mutable std::map<std::pair<std::string, int>, double> widths_;  // of words already measured
};

/// The words where they are at most `width` pixels wide, else as many of them as are, with an ellipsis.
std::string shortened(const Canvas& canvas, const std::string& words, double size, bool bold, double width);

}  // namespace palpate::render
