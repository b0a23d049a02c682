#pragma once

#include <string_view>

namespace palpate::report {

/// A script or style that pages are made of, by its name in report/ ("assets/report.css"); empty for an unknown one.
std::string_view asset(std::string_view file) noexcept;
/// The same of the library that draws interactive charts.
std::string_view chartLibrary(std::string_view file) noexcept;

}  // namespace palpate::report
