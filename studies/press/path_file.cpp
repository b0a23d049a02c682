#include <studies/press/path_file.h>

#include <base/error.h>
#include <base/inputs.h>
#include <base/split.h>
#include <haptics/tick.h>
#include <volume/direction.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <string_view>

namespace palpate::studies {

using haptics::tickSeconds;

namespace {

constexpr double farthest = 10.0;      // from the origin along each axis [m]
constexpr double latest = 1e9;         // more than any clock says [s]
constexpr double maxTicks = 10e6;      // nearly three hours
constexpr double halfTurn = -0.999;    // cosine between axes of which neither way round is the shorter
constexpr double pathRounding = 1e-6;  // of a tick

constexpr std::string_view byteOrderMark = "\xEF\xBB\xBF";  // spreadsheets write one

const std::vector<std::string> pathColumns{"x_mm", "y_mm", "z_mm", "seconds", "axis_x", "axis_y", "axis_z"};
constexpr std::size_t seconds = 3, axis = 4;  // their places; positions come first
const std::vector<std::string> pointColumns{"x_mm", "y_mm", "z_mm"};

// What a cell holds, for a message: of a file that is no text at all, too. Other than ASCII letters become question marks.
std::string cellInWords(std::string_view cell)
{
    constexpr std::size_t longest = 60;
    std::string words(cell.substr(0, longest));
    std::ranges::replace_if(
        words, [](char c) { return c < ' ' || c > '~'; }, '?');
    return cell.size() > longest ? words + "..." : words;
}

// A CSV file of numbers, row by row.
class NumberFile {
public:
    NumberFile(std::istream& in, std::string origin, const std::vector<std::string>& known)
        : in_(in), origin_(std::move(origin)), known_(known), place_(known.size())
    {
        base::failIf(!next(), "{}: holds no line of column names: begin with {}", origin_, fmt::join(known_, ","));
        for (const std::string_view name : base::csvCells(line_)) {
            addColumn(name);
        }
        for (const char* name : {"x_mm", "y_mm", "z_mm"}) {
            require(name);
        }
    }

    bool has(std::size_t column) const { return place_[column].has_value(); }

    void require(const std::string& name) const
    {
        base::failIf(!has(static_cast<std::size_t>(std::ranges::find(known_, name) - known_.begin())),
                     "{}: column {} is missing: the columns are {}", where(), name, fmt::join(known_, ", "));
    }

    bool nextRow()
    {
        if (!next()) {
            return false;
        }
        cells_ = base::csvCells(line_);
        base::failIf(cells_.size() != count_, "{}: {} values: must be {}, one per column", where(), cells_.size(), count_);
        return true;
    }

    double number(std::size_t column, double most, const char* unit) const
    {
        const std::string_view cell = cells_[*place_[column]];
        const std::optional<double> value = base::numberIn(cell);
        if (!value || !std::isfinite(*value)) {
            throw base::error("{}: {} = '{}': must be a number", where(), known_[column], cellInWords(cell));
        }
        if (std::abs(*value) > most) {
            throw base::error("{}: {} = {:g}: must be {:g} to {:g}{}", where(), known_[column], *value, -most, most, unit);
        }
        return *value;
    }

    Vec3 position() const
    {
        constexpr double most = 1e3 * farthest;
        return 1e-3 * Vec3(number(0, most, " mm"), number(1, most, " mm"), number(2, most, " mm"));
    }

    std::string where() const { return fmt::format("{}:{}", origin_, number_); }

private:
    // The next line that counts.
    bool next()
    {
        while (std::getline(in_, line_)) {
            if (++number_ == 1 && line_.starts_with(byteOrderMark)) {
                line_.erase(0, byteOrderMark.size());
            }
            if (const auto text = base::trimmed(line_); !text.empty() && text.front() != '#') {
                return true;
            }
        }
        base::failIf(in_.bad(), "{}: cannot be read to its end", origin_);
        return false;
    }

    void addColumn(std::string_view name)
    {
        if (name.size() > 1 && name.front() == '"' && name.back() == '"') {  // as R writes names
            name = name.substr(1, name.size() - 2);
        }
        const auto at = std::ranges::find(known_, name);
        base::failIf(at == known_.end(), "{}: column '{}' is not known: the columns are {}", where(), cellInWords(name),
                     fmt::join(known_, ", "));
        auto& place = place_[static_cast<std::size_t>(at - known_.begin())];
        base::failIf(place.has_value(), "{}: column {} is there twice", where(), name);
        place = count_++;
    }

    std::istream& in_;
    std::string origin_;
    const std::vector<std::string>& known_;
    std::vector<std::optional<std::size_t>> place_;  // of each known column in the file
    std::string line_;
    std::vector<std::string_view> cells_;
    std::size_t count_ = 0;
    int number_ = 0;
};

std::ifstream opened(const std::filesystem::path& file, const char* what)
{
    const std::string why = base::whyNoFile(file);
    std::ifstream in;
    if (why.empty()) {
        in.open(file);
    }
    base::failIf(!in.is_open(), "{}: {}; give {}", file.string(), why.empty() ? "cannot be read" : why, what);
    return in;
}

Vec3 axisOf(const NumberFile& file)
{
    constexpr double most = std::numeric_limits<double>::max();
    const Vec3 along =
        volume::rescaled({file.number(axis, most, ""), file.number(axis + 1, most, ""), file.number(axis + 2, most, "")});
    const double length = glm::length(along);
    base::failIf(!(length > 0), "{}: the axis is zero: it must say where the tool points to", file.where());
    return along / length;
}

void checkFollows(const NumberFile& file, const ToolPose& before, const ToolPose& pose)
{
    base::failIf(!(pose.seconds > before.seconds), "{}: seconds = {:g}: must be after {:g}, the row before", file.where(),
                 pose.seconds, before.seconds);
    base::failIf(glm::dot(before.axis, pose.axis) < halfTurn,
                 "{}: the axis turns by half a turn from the row before: add a row between that says which way",
                 file.where());
}

}  // namespace

std::size_t PosePath::ticks() const noexcept
{
    const double span = poses.back().seconds - poses.front().seconds;
    return 1 + static_cast<std::size_t>(std::max(0.0, std::ceil(span / tickSeconds - pathRounding)));
}

ToolPose PosePath::at(std::size_t tick) const noexcept
{
    const double t = poses.front().seconds + static_cast<double>(tick) * tickSeconds;
    const auto after = std::ranges::upper_bound(poses, t, {}, &ToolPose::seconds);
    ToolPose pose = after == poses.begin() ? poses.front() : *(after - 1);
    if (after != poses.begin() && after != poses.end()) {
        const double fraction = (t - pose.seconds) / (after->seconds - pose.seconds);
        pose.position = glm::mix(pose.position, after->position, fraction);
        pose.axis = glm::normalize(glm::mix(pose.axis, after->axis, fraction));
    }
    pose.seconds = t;
    return pose;
}

PosePath readPosePath(std::istream& in, const std::string& origin, std::optional<Vec3> standardAxis)
{
    NumberFile file(in, origin, pathColumns);
    const bool timed = file.has(seconds);
    const bool turned = file.has(axis) || file.has(axis + 1) || file.has(axis + 2);
    base::failIf(!turned && !standardAxis, "{}: the scene has no planned line: add the columns axis_x,axis_y,axis_z",
                 origin);
    for (std::size_t c = axis; turned && c < pathColumns.size(); ++c) {
        file.require(pathColumns[c]);
    }
    PosePath path;
    path.origin = origin;
    while (file.nextRow()) {
        ToolPose pose{file.position(), turned ? axisOf(file) : *standardAxis};
        pose.seconds = timed ? file.number(seconds, latest, " s") : tickSeconds * static_cast<double>(path.poses.size());
        if (!path.poses.empty()) {
            checkFollows(file, path.poses.back(), pose);
        }
        path.poses.push_back(pose);
        if (const double span = pose.seconds - path.poses.front().seconds; span > maxTicks * tickSeconds) {
            throw base::error("{}: {:g} s after the first row: a path may take {:g} s at most", file.where(), span,
                              maxTicks * tickSeconds);
        }
    }
    base::failIf(path.poses.empty(), "{}: holds no pose: write at least one row under the column names", origin);
    return path;
}

PosePath loadPosePath(const std::filesystem::path& file, std::optional<Vec3> standardAxis)
{
    std::ifstream in = opened(file, "a path (CSV with the columns x_mm,y_mm,z_mm)");
    return readPosePath(in, file.string(), standardAxis);
}

std::vector<FilePoint> loadPoints(const std::filesystem::path& file)
{
    std::ifstream in = opened(file, "points (CSV with the columns x_mm,y_mm,z_mm)");
    NumberFile table(in, file.string(), pointColumns);
    std::vector<FilePoint> points;
    while (table.nextRow()) {
        points.push_back({table.position(), table.where()});
    }
    base::failIf(points.empty(), "{}: holds no point: write at least one row under the column names", file.native());
    return points;
}

}  // namespace palpate::studies
