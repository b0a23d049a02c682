#pragma once

// ITK, as Debian builds it, asks for GCC and refuses clang, which builds the tests with sanitizers. Include this before
// ITK: its header on compilers is read once, with GCC's name; what it says of GCC 12 holds for clang 16.
#ifdef __clang__
#pragma clang diagnostic push
#pragma clang diagnostic ignored "-Wbuiltin-macro-redefined"
#pragma push_macro("__clang__")
#pragma push_macro("__GNUC__")
#undef __clang__
#undef __GNUC__
#define __GNUC__ 12
#include <itk_compiler_detection.h>
#pragma pop_macro("__GNUC__")
#pragma pop_macro("__clang__")
#pragma clang diagnostic pop
#endif
