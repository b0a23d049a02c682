#pragma once

namespace palpate::base {

/// For a process that does one thing for its parent, behind a fork or as a program started for it: it does not outlive its
/// parent, leaves no core behind, and what it or a library prints goes nowhere. What is wrong is told in another way.
void becomeQuietChild() noexcept;

}  // namespace palpate::base
