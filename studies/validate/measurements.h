#pragma once

#include <filesystem>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::studies {

/// Thrown for a set of measurements that is not there: the experiment is not run.
struct NoMeasurement : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// A table of measurements: lines that start with # say what it is, then names of columns, then rows.
class Measurements {
public:
    /// Throws NoMeasurement when there is no such file, std::runtime_error ("FILE, line N: ...") for one that is damaged.
    explicit Measurements(const std::filesystem::path& file);

    std::size_t rows() const noexcept { return cells_.size(); }
    const std::string& text(std::size_t row, std::string_view column) const;
    /// Throws std::runtime_error for a cell that is no number, or none that is finite.
    double number(std::size_t row, std::string_view column) const;

private:
    std::filesystem::path file_;
    std::map<std::string, std::size_t, std::less<>> columns_;
    std::vector<std::vector<std::string>> cells_;
    std::vector<std::size_t> lines_;  // of each row
};

/// Where measurements are looked for, in this order: `asked`, $PALPATE_MEASURED, what comes with the program.
std::vector<std::filesystem::path> measurementFolders(const std::filesystem::path& asked);

/// The file in the first folder that has it. Throws NoMeasurement.
std::filesystem::path measurementFile(const std::vector<std::filesystem::path>& folders, const std::string& name);

}  // namespace palpate::studies
