#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

namespace palpate::studies {

/// A straight line y = intercept + slope x by least squares, with standard errors, as Table 4 of the thesis has them.
struct LineFit {
    std::size_t points = 0;
    double slope = 0, slopeError = 0;
    double intercept = 0, interceptError = 0;
    double rSquared = 0;  // fraction of the variance of y that the line explains; 1 where y does not vary
    double residual = 0;  // standard deviation of the points about the line

    double at(double x) const noexcept { return intercept + slope * x; }
    /// Zero lies in the slope's 95 % interval: the points show no dependence on x.
    bool flat() const noexcept;
};

/// Throws std::runtime_error for fewer than three points and where x does not vary.
LineFit fitLine(std::span<const double> x, std::span<const double> y);

/// The 97.5 % quantile of Student's t: so many standard errors to both sides hold 95 %.
/// @param freedom  points less parameters, 1 or more
double studentQuantile(std::size_t freedom) noexcept;

/// The events of the thesis (Table 3): what is switched on while the load of the millisecond is read.
struct TaskEvent {
    std::string_view name;
    bool haptics = false;     // collision and force feedback: H3, H4, H5
    bool graphics = false;    // H8, H9
    bool touching = false;    // where haptics are on
    bool monitoring = false;  // H6 counts
    bool additional = false;  // H7
};

/// In the order of Table 3. A13 and A14 are A5 and A6 again.
inline constexpr std::array<TaskEvent, 14> taskEvents{{{"A1", true, true, true, false, false},
                                                       {"A2", true, false, true, false, false},
                                                       {"A3", true, true, false, false, false},
                                                       {"A4", true, false, false, false, false},
                                                       {"A5", false, true, false, false, false},
                                                       {"A6", false, false, false, false, false},
                                                       {"A7", true, true, true, true, true},
                                                       {"A8", true, false, true, true, true},
                                                       {"A9", true, true, false, false, true},
                                                       {"A10", true, false, false, false, true},
                                                       {"A11", false, true, false, false, true},
                                                       {"A12", false, false, false, false, true},
                                                       {"A13", false, true, false, false, false},
                                                       {"A14", false, false, false, false, false}}};

/// What the thesis measured on a 300 MHz Pentium with GHOST and a PHANToM, spheres that do not overlap. Times in seconds;
/// the thesis gives tenths of a millisecond.
struct ThesisSeries {
    std::string_view event;
    std::vector<double> objects, seconds;  // Table 2; of one length
    LineFit line;                          // Table 4: as the thesis prints it, without R^2
};

/// Events A1 to A4 and A7 to A10, in order.
const std::vector<ThesisSeries>& thesisSeries();
/// The series of an event, or nothing.
const ThesisSeries* thesisSeries(std::string_view event);

/// Numbers of objects in Table 2.
inline constexpr std::array<int, 14> thesisObjects{25, 50, 75, 100, 150, 200, 250, 300, 350, 400, 450, 500, 550, 600};
inline constexpr double thesisUnit = 1e-4;            // of its tables [s]
inline constexpr double thesisA6 = 0.8e-4;            // [s]
inline constexpr double thesisHapticLimit = 0.08e-3;  // in which haptic rendering should be done (chapter VI) [s]

/// A time that is linear in the number of objects.
struct TaskLine {
    double slope = 0;      // [s per object]
    double intercept = 0;  // [s]

    double at(double objects) const noexcept { return intercept + slope * objects; }
};

/// The task-timing model of the thesis, equations 9 to 29, from the lines of events.
///
///     graphics   Y_G  = A1 - A2                     (11)
///     position   Y_P  = A6
///     collision  Y_CD = A4 - A6                     (12)
///     feedback   Y_F  = A2 - A4                     (17)
///     monitoring Y_MT = (A7 - A9) - Y_F             (24)
///     additional Y_AF = (A7 - A1) - Y_MT            (28)
///
/// Taken over lines the sum telescopes: servo() + graphics is the line of A1, total() that of A7. So the model cannot fail
/// to agree with A1 and A7; what it tells is how the time divides.
struct TaskModel {
    TaskLine graphics, position, collision, feedback, monitoring, additional;

    TaskLine servo() const noexcept;  // Y_SV, equation 18: H2 to H5
    TaskLine total() const noexcept;  // Y_T, equation 29
};

/// Lines of events by name; A1, A2, A4, A6, A7 and A9 have to be there. Throws std::runtime_error for one that is not.
struct EventLine {
    std::string_view event;
    TaskLine line;
};
TaskModel taskModel(std::span<const EventLine> lines);

/// That of the thesis, from Table 4 and A6.
TaskModel thesisModel();

}  // namespace palpate::studies
