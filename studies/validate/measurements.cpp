#include <base/child_process.h>
#include <base/error.h>
#include <studies/validate/experiment.h>
#include <studies/validate/measurements.h>

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <fstream>

namespace palpate::studies {

namespace fs = std::filesystem;

namespace {

// Cells of a line; commas between quotes do not part.
std::vector<std::string> cellsOf(const std::string& line)
{
    std::vector<std::string> cells(1);
    bool quoted = false;
    for (const char c : line) {
        if (c == '"') {
            quoted = !quoted;
        } else if (c == ',' && !quoted) {
            cells.emplace_back();
        } else if (c != '\r') {
            cells.back() += c;
        }
    }
    return cells;
}

}  // namespace

Measurements::Measurements(const fs::path& file) : file_(file)
{
    std::ifstream in(file);
    if (!in) {
        throw NoMeasurement(file.string() + ": is not there or cannot be read");
    }
    std::string line;
    for (std::size_t number = 1; std::getline(in, line); ++number) {
        if (line.empty() || line[0] == '#') {
            continue;
        }
        auto cells = cellsOf(line);
        if (columns_.empty()) {
            for (std::size_t i = 0; i < cells.size(); ++i) {
                columns_[cells[i]] = i;
            }
        } else if (cells.size() != columns_.size()) {
            throw base::error("{}, line {}: {} cells where the head names {} columns", file.string(), number, cells.size(),
                              columns_.size());
        } else {
            cells_.push_back(std::move(cells));
            lines_.push_back(number);
        }
    }
    base::failIf(cells_.empty(), "{}: has no rows", file.native());
}

const std::string& Measurements::text(std::size_t row, std::string_view column) const
{
    const auto found = columns_.find(column);
    base::failIf(found == columns_.end(), "{}: has no column '{}'", file_.native(), column);
    return cells_[row][found->second];
}

double Measurements::number(std::size_t row, std::string_view column) const
{
    const std::string& cell = text(row, column);
    char* end = nullptr;
    const double value = std::strtod(cell.c_str(), &end);
    base::failIf(cell.empty() || *end != '\0' || !std::isfinite(value), "{}, line {}: {} is '{}', which is no number",
                 file_.native(), lines_[row], column, cell);
    return value;
}

std::vector<fs::path> measurementFolders(const fs::path& asked)
{
    std::vector<fs::path> folders;
    if (!asked.empty()) {
        folders.push_back(asked);
    }
    if (const char* named = std::getenv("PALPATE_MEASURED"); named != nullptr && *named != '\0') {
        folders.emplace_back(named);
    }
    folders.emplace_back(PALPATE_MEASURED_FOLDER);
    folders.push_back(base::programFolder() / "../share/palpate/measured");
    return folders;
}

fs::path measurementFile(const std::vector<fs::path>& folders, const std::string& name)
{
    for (const fs::path& folder : folders) {
        if (fs::exists(folder / name)) {
            return folder / name;
        }
    }
    throw NoMeasurement(fmt::format("no {} in {}: name its folder with --data or PALPATE_MEASURED", name,
                                    folders.front().lexically_normal().string()));
}

ErrorSummary summaryOf(const std::vector<double>& errors) noexcept
{
    ErrorSummary out;
    for (const double e : errors) {
        out.rms += e * e;
        out.worst = largerError(out.worst, std::abs(e));
    }
    out.rms = errors.empty() ? NAN : std::sqrt(out.rms / static_cast<double>(errors.size()));
    return out;
}

}  // namespace palpate::studies
