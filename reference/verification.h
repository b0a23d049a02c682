#pragma once

#include <functional>
#include <string>
#include <vector>

namespace palpate::reference {

/// One figure of the finite-element reference beside a closed form.
struct VerificationRow {
    std::string problem;
    std::string quantity;     // with its unit
    double ours = 0;          // in that unit
    double reference = 0;     //
    double errorPercent = 0;  // |ours - reference| / reference, or a relative norm of the difference
    double bound = 0;         // of errorPercent
    std::string source;       // of the reference
    std::string setting;      // law, elements, mesh
};

/// Coarse meshes with wider bounds for tests (seconds), or meshes that the figures are quoted from (minutes).
enum class Fineness : std::uint8_t { quick, full };

/// Solves every problem that has a closed form: uniform fields, point force, inclusion, stretch, sphere and punch on a
/// thick and on a thin layer.
/// @param progress  told the name of each problem before it is solved; may be none
std::vector<VerificationRow> verifyReference(Fineness fineness, const std::function<void(const std::string&)>& progress);

}  // namespace palpate::reference
