#include <python/explained_call.h>

namespace palpate::python {

namespace {

namespace py = pybind11;

// What pybind11 has in the method table of each function.
struct BoundFunction : py::cpp_function {
    using py::cpp_function::dispatcher;
};

// Replaces the TypeError that is set, where it is about arguments.
void explain(PyObject* given, PyObject* named)
{
    py::error_already_set error;
    try {
        const auto words = named != nullptr ? py::reinterpret_borrow<py::object>(named) : py::object(py::dict());
        const py::object explained = py::module_::import("palpate._arguments").attr("explained");
        const py::object text = explained(py::str(error.value()), py::handle(given), words);
        if (text.is_none()) {
            error.restore();
        } else {
            PyErr_SetObject(PyExc_TypeError, text.ptr());
        }
    } catch (const py::error_already_set&) {
        error.restore();
    }
}

}  // namespace

PyObject* explainedCall(PyObject* function, PyObject* given, PyObject* named)
{
    PyObject* const result = BoundFunction::dispatcher(function, given, named);
    if (result == nullptr && PyErr_ExceptionMatches(PyExc_TypeError) != 0) {
        explain(given, named);
    }
    return result;
}

}  // namespace palpate::python
