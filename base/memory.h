#pragma once

namespace palpate::base {

/// Memory that this program can still get without swapping [bytes]: what the system has free (/proc/meminfo, MemAvailable)
/// and what the control groups of this process leave it, the less of them. Infinity where nothing tells.
double availableMemory();

}  // namespace palpate::base
