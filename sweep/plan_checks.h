#pragma once

#include <datasets/toml_section.h>
#include <sweep/plan.h>

#include <string>

namespace palpate::sweep {

// What is wrong in a plan is known before its first case runs. Each throws std::runtime_error ("FILE: what is wrong").

/// What formulas and columns call an output, and what a reference adds: X, reference_X, X_change_pct.
std::vector<std::string> namesOf(const OutputInfo& output, bool compared);
/// No two columns of the table have one name: small and capital letters are the same, as for SQLite.
void checkColumns(datasets::Section& top, const SweepPlan& plan);
/// No two names that formulas see are one: axes, the words of an axis (AXIS_WORD), and what a procedure of `kind` measures.
void checkVariables(datasets::Section& top, const SweepPlan& plan, ProcedureKind kind);
/// No key is set twice: by two axes, or by an axis and [procedure] or [set].
void checkKeys(datasets::Section& top, const SweepPlan& plan);
/// The scenes of some cases, spread evenly, and of one with each value of each list.
void probeCases(const SweepPlan& plan, const std::string& file);
/// The formulas of the outputs, on the first case.
void probeOutputs(const SweepPlan& plan, const std::string& file);

}  // namespace palpate::sweep
