#pragma once

#include <pybind11/pybind11.h>

namespace palpate::python {

/// Calls a function of this module, as pybind11 does for all of them. Where the arguments do not fit, its TypeError of
/// several lines becomes one that says on one line what is wrong (palpate/_arguments.py). Other calls pay for one jump.
PyObject* explainedCall(PyObject* function, PyObject* given, PyObject* named);

}  // namespace palpate::python
