#pragma once

#include <cmath>
#include <vector>

namespace palpate::training {

/// Sums of weights that differ by less are the same.
inline constexpr double cusumTie = 1e-9;

/// What a CUSUM chart of failures tells apart, and how sure it is.
///
/// The weight of a session is the logarithm of its likelihood ratio: a failure adds ln(p1/p0), a success adds
/// ln((1-p1)/(1-p0)), which is below 0. Two charts go by it, each held at 0 from below:
///
///     alarm     A = max(0, A + weight)   at or over ln((1-beta)/alpha):  fails as often as p1, look into it
///     learning  L = max(0, L - weight)   at or over ln((1-alpha)/beta):  fails as seldom as p0, has learnt it
///
/// After a signal a chart begins anew at 0. The limits are Wald's of the sequential test; a chart that is held at 0 signals
/// at some time whatever the failure rate, so averageRunLength() says what they mean in sessions.
/// Source: E. S. Page, "Continuous inspection schemes", Biometrika 41, 1954 (the chart); A. Wald, "Sequential analysis",
/// 1947 (the limits); D. J. Biau and R. Porcher, "A method for monitoring a process from an out of control to an in control
/// state: application to the learning curve", Statistics in Medicine 29, 2010 (the learning chart).
struct CusumPlan {
    double p0 = 0.1;      // acceptable failure rate, 0 < p0 < p1 < 1
    double p1 = 0.3;      // unacceptable failure rate
    double alpha = 0.05;  // of taking p0 for p1, 0 to 0.5
    double beta = 0.1;    // of taking p1 for p0, 0 to 0.5

    double failureWeight() const noexcept { return std::log(p1 / p0); }
    double successWeight() const noexcept { return std::log((1 - p1) / (1 - p0)); }  // below 0
    double alarmLimit() const noexcept { return std::log((1 - beta) / alpha); }
    double learningLimit() const noexcept { return std::log((1 - alpha) / beta); }
};

/// Both charts after each session.
struct CusumPoint {
    double alarm = 0, learning = 0;            // before it begins anew
    bool alarmed = false, proficient = false;  // signals in this session
};

/// @param failed  by session, in their order
std::vector<CusumPoint> cusum(const CusumPlan& plan, const std::vector<bool>& failed);

enum class CusumChart { alarm, learning };

/// Mean number of sessions until a chart signals, from 0 on, where a session fails with probability `failureRate`, each on
/// its own. From the chart's Markov chain over all values that it can take, or over 2000 of them where there are more (D.
/// Brook and D. A. Evans, "An approach to the probability distribution of cusum run length", Biometrika 59, 1972).
/// @param failureRate  0 to 1; infinite where no signal can come
double averageRunLength(const CusumPlan& plan, CusumChart chart, double failureRate);

}  // namespace palpate::training
