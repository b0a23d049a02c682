#pragma once

namespace palpate::base {

/// The main direction of a way in the patient frame LPS, behind "towards": "the head", "the patient's left".
const char* directionInWords(double left, double back, double head) noexcept;

}  // namespace palpate::base
