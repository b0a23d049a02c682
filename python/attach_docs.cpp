#include <python/convert.h>
#include <python/docs.h>
#include <python/explained_call.h>

#include <cstdlib>
#include <string>

namespace palpate::python {

namespace {

// The object of a name with dots, without what a lookup through its class would make of it.
py::object objectOf(const py::module_& module, const std::string& name)
{
    const auto dot = name.find('.');
    const auto owner = py::object(module.attr(name.substr(0, dot).c_str()));
    if (dot == std::string::npos) {
        return owner;
    }
    const auto members = py::object(owner.attr("__dict__"));
    return members[name.substr(dot + 1).c_str()];
}

// The built-in function in a method, a static method or by itself; null: it is none.
PyObject* functionIn(PyObject* object)
{
    if (PyInstanceMethod_Check(object)) {
        object = PyInstanceMethod_Function(object);
    } else if (std::string(Py_TYPE(object)->tp_name) == "staticmethod") {
        object = py::object(py::reinterpret_borrow<py::object>(object).attr("__func__")).ptr();
    }
    return PyCFunction_Check(object) ? object : nullptr;
}

}  // namespace

void attachDocs(py::module_& module)
{
    for (const auto& [name, text] : docs()) {
        const py::object object = objectOf(module, name);
        if (PyObject* const function = functionIn(object.ptr())) {
            // pybind11 has put a text of its own there, on the heap; it frees what it finds.
            PyMethodDef* const method = reinterpret_cast<PyCFunctionObject*>(function)->m_ml;
            std::free(const_cast<char*>(method->ml_doc));
            method->ml_doc = PYBIND11_COMPAT_STRDUP(text);
            method->ml_meth = reinterpret_cast<PyCFunction>(reinterpret_cast<void (*)()>(explainedCall));
        } else {
            object.attr("__doc__") = text;
        }
    }
}

}  // namespace palpate::python
