#include <report/path.h>

#include <report/html.h>

#include <fmt/format.h>

#include <glm/gtx/component_wise.hpp>

#include <algorithm>
#include <array>

namespace palpate::report {

namespace {

constexpr double side = 300;     // of a drawing [px]
constexpr double margin = 5;     // around what is drawn [mm]
constexpr double tallest = 160;  // of what is drawn [mm]: further out the path is cut off

// A view: which axes of the patient run to the right and down, and which way.
struct View {
    const char* title;
    int right, down;
    double rightSign, downSign;
};
// LPS: x to the patient's left, y to the back, z to the head.
constexpr std::array<View, 3> views{{{"from the feet (right: the patient's left, down: back)", 0, 1, 1, 1},
                                     {"from the left (right: back, up: head)", 1, 2, 1, -1},
                                     {"from the front (right: the patient's left, up: head)", 0, 2, 1, -1}}};

struct Frame {
    Vec3 middle{0.0};   // [mm]
    double extent = 0;  // [mm]
};

Frame frameOf(const ReportData& d, const std::optional<haptics::TargetShape>& target)
{
    Vec3 low(1e9), high(-1e9);
    const auto take = [&](Vec3 p, double radius) {
        low = glm::min(low, p - radius);
        high = glm::max(high, p + radius);
    };
    for (const Core& core : d.cores) {
        take(core.sample.notchEnd * 1e3, 0);
    }
    if (target) {
        take(target->middle * 1e3, target->diameter * 500);
    }
    for (const PathPoint& p : d.path) {
        p.inside ? take(p.tip, 0) : void();
    }
    const auto middle = [&] { return 0.5 * (low + high); };
    const auto extent = [&] { return glm::compMax(high - low) + 2 * margin; };
    const Frame tissue{middle(), extent()};
    for (const PathPoint& p : d.path) {
        take(p.tip, 0);
    }
    // Where not all has room, what lies in the body has.
    const bool isCut = extent() > tallest && tissue.extent > 0;
    return {isCut ? tissue.middle : middle(), std::min(tallest, extent())};
}

class Drawing {
public:
    Drawing(const View& view, const Frame& frame) : view_(view), frame_(frame), scale_(side / frame.extent) {}

    std::string at(Vec3 p) const
    {
        const Vec3 away = p - frame_.middle;
        return fmt::format("{:.1f},{:.1f}", side / 2 + scale_ * view_.rightSign * away[view_.right],
                           side / 2 + scale_ * view_.downSign * away[view_.down]);
    }
    void circle(Vec3 p, double radius, const char* style)
    {
        const std::string xy = at(p);
        const std::size_t comma = xy.find(',');
        out_ += fmt::format("<circle cx=\"{}\" cy=\"{}\" r=\"{:.1f}\" {}/>", xy.substr(0, comma), xy.substr(comma + 1),
                            std::max(2.0, scale_ * radius), style);
    }
    void line(const std::vector<Vec3>& points, const char* style)
    {
        out_ += "<polyline fill=\"none\" points=\"";
        for (const Vec3& p : points) {
            out_ += at(p) + ' ';
        }
        out_ += fmt::format("\" {}/>", style);
    }
    std::string finish() const
    {
        const double bar = 10 * scale_;
        return fmt::format(
            "<figure><svg viewBox=\"0 0 {0:.0f} {0:.0f}\" width=\"100%\" fill=\"currentColor\" role=\"img\" "
            "aria-label=\"{1}\">{2}<rect x=\"8\" y=\"{3:.0f}\" width=\"{4:.1f}\" height=\"2\"/><text x=\"8\" "
            "y=\"{5:.0f}\" font-size=\"10\">10 mm</text></svg><figcaption>{1}</figcaption></figure>",
            side, view_.title, out_, side - 8, bar, side - 12);
    }

private:
    const View& view_;
    const Frame& frame_;
    double scale_;  // [px/mm]
    std::string out_;
};

// The path in pieces that lie all inside or all outside; each begins where the last ended.
void drawPath(const std::vector<PathPoint>& path, Drawing& drawing)
{
    std::vector<Vec3> piece;
    for (std::size_t i = 0; i < path.size(); ++i) {
        piece.push_back(path[i].tip);
        const bool last = i + 1 == path.size();
        if (last || path[i + 1].inside != path[i].inside) {
            drawing.line(piece, path[i].inside ? "stroke=\"#c33\" stroke-width=\"1.2\""
                                               : "stroke=\"#789\" stroke-width=\"0.8\" stroke-dasharray=\"3 2\"");
            piece.assign(1, path[i].tip);
        }
    }
}

std::string draw(const View& view, const Frame& frame, const ReportData& d,
                 const std::optional<haptics::TargetShape>& target, const std::string& colour)
{
    Drawing drawing(view, frame);
    if (target) {
        const std::string style = fmt::format("fill=\"{}\" opacity=\"0.45\"", colour);
        drawing.circle(target->middle * 1e3, target->diameter * 500, style.c_str());
    }
    if (target) {
        // The way that was planned leads to the middle of the target, or near it.
        const Vec3 middle = target->middle * 1e3;
        drawing.line({middle - 150.0 * target->axis, middle},
                     "stroke=\"#26c\" stroke-width=\"1\" stroke-dasharray=\"6 3\"");
    }
    drawPath(d.path, drawing);
    for (const Vec3& entry : d.entries) {
        drawing.circle(entry, 0.9, "fill=\"#b07040\"");
    }
    for (const Core& core : d.cores) {
        drawing.line({core.sample.notchStart * 1e3, core.sample.notchEnd * 1e3},
                     "stroke=\"currentColor\" stroke-width=\"4\" opacity=\"0.55\"");
    }
    for (const Vec3& mark : d.marks) {
        drawing.circle(mark, 1, "fill=\"currentColor\"");
    }
    return drawing.finish();
}

}  // namespace

std::string pathCard(const ReportData& d, const haptics::SessionInfo& info)
{
    if (d.path.size() < 2) {
        return {};
    }
    const auto target = haptics::targetShapeOf(info);
    const Frame frame = frameOf(d, target);
    std::string colour = info.structures.empty() ? "" : tissueColour(info.structures[0]);
    colour = colour.empty() ? tissueColour("idc_high_grade") : colour;
    const std::string dots =
        d.entryCount > d.entries.size() ? fmt::format(" (the first {} of {})", d.entries.size(), d.entryCount) : "";
    std::string out =
        "<section class=\"card\"><h2>Path of the tip</h2><p class=\"note\">Grey and dashed outside the body, red "
        "inside; brown dots where the tip met the skin" +
        dots +
        ", the blue dashed line along the planned direction through the target's middle; dark bars are the notches at "
        "firing, dark dots the trainee's marks. The disc is a ball of the target's volume where it lies at rest, in the "
        "viewer's colour.</p><div class=\"pictures\" style=\"grid-template-columns:repeat(auto-fit,minmax(220px,1fr))\">";
    for (const View& view : views) {
        out += draw(view, frame, d, target, colour);
    }
    return out + "</div></section>";
}

}  // namespace palpate::report
