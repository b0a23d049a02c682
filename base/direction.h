#pragma once

namespace palpate::base {

/// Where an axis of the patient frame LPS (0, 1, 2) leads, behind "towards": "the patient's left", "the head".
const char* sideInWords(int axis, bool positive) noexcept;

/// The main direction of a way in that frame, likewise.
const char* directionInWords(double left, double back, double head) noexcept;

}  // namespace palpate::base
