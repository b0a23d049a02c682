#pragma once

#include <functional>
#include <string>
#include <vector>

namespace palpate::studies {

/// A number of the elastic kernel beside a closed form.
struct KernelVerification {
    std::string problem;      // "Hertz: sphere on a half-space"
    std::string quantity;     // "force [N]"
    std::string setting;      // "1 mm"
    double spacing = 0;       // of the finest nodes [m]
    double ours = 0;          // in the quantity's unit
    double reference = 0;     //
    double errorPercent = 0;  // of the reference, signed
    double bound = 0;         // |errorPercent| allowed [%]
    double order = 0;         // of convergence from the next coarser spacing; 0: there is none, or no error is left
    std::string source;       // of the closed form

    bool holds() const noexcept;
};

/// Solves the problems that have a closed form at spacings of 2, 1 and 0.5 mm (`quick`: without the last), and first touch,
/// contacts of a quarter of a cell to two cells at several places in the grid and surfaces at a quarter, half and three
/// quarters of their cells (`quick`: half), at 2 mm. Cost: minutes.
/// @param progress  is told what comes next
std::vector<KernelVerification> verifyKernel(bool quick, const std::function<void(const std::string&)>& progress);

}  // namespace palpate::studies
