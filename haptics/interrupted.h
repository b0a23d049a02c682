#pragma once

namespace palpate::haptics {

/// Of a record's results: the signal that ended its session before its time, in words. Other sessions have no such key.
inline constexpr const char* interruptedKey = "interrupted";

}  // namespace palpate::haptics
