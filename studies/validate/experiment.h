#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace palpate::studies {

/// A line or points of an experiment's picture.
struct ValidateCurve {
    std::string name;
    std::vector<double> x, y;
    bool line = true;  // false: points
};

struct ValidatePicture {
    std::string title, xLabel, yLabel;
    std::vector<ValidateCurve> curves;
    bool empty() const noexcept { return curves.empty(); }
};

enum class Verdict : std::uint8_t { holds, fails, notRun };

/// What was measured, what was fitted on which part, what was predicted, and how far off that is. All errors are in
/// percent, of what `quantity` says, and an experiment holds when `error` is at most `bound`.
struct Experiment {
    std::string name;      // as the command takes it
    std::string quantity;  // that is compared, and what the percentage is of
    std::string source;    // of the measurement
    std::string fittedOn;
    std::string predicted;
    double error = 0;    // RMS, or what `quantity` says [%]
    double worst = 0;    // largest single error [%]
    double scatter = 0;  // of the measurement [%]
    double bound = 0;    // [%]
    Verdict verdict = Verdict::notRun;
    std::string note;                                        // what it shows, or why it was not run
    std::vector<std::pair<std::string, double>> parameters;  // that were fitted, and other figures, with unit in the name
    ValidatePicture picture;

    /// Sets the verdict by error and bound; an error that is not finite fails.
    void judge() noexcept { verdict = error <= bound ? Verdict::holds : Verdict::fails; }
};

/// The larger of two errors; one that is no number wins, so that it is not lost.
inline double largerError(double a, double b) noexcept
{
    return std::isnan(a) || a >= b ? a : b;
}

/// Root of the mean square, and the largest size; no numbers where one of the errors is none.
struct ErrorSummary {
    double rms = 0, worst = 0;
};
ErrorSummary summaryOf(const std::vector<double>& errors) noexcept;

/// Called with what is being done.
using ValidateProgress = std::function<void(const std::string&)>;

}  // namespace palpate::studies
