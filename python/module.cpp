#include <base/build.h>
#include <python/convert.h>

namespace {

namespace py = pybind11;

// TYPE.__new__(TYPE) gives an object that nothing has constructed: to look at it would end the process. TYPE(..) does not
// look __new__ up and goes on as before; so do classes that Python derives.
void refuseNew(const py::handle& object)
{
    auto* const type = reinterpret_cast<PyTypeObject*>(object.ptr());
    const newfunc made = type->tp_new;
    const auto refuse = [type, made](const py::handle& of, const py::args& args, const py::kwargs& named) {
        if (of.ptr() == reinterpret_cast<PyObject*>(type)) {
            throw py::type_error(std::string(type->tp_name) + ".__new__: gives no object: call the type itself");
        }
        return py::reinterpret_steal<py::object>(made(reinterpret_cast<PyTypeObject*>(of.ptr()), args.ptr(), named.ptr()));
    };
    const py::staticmethod function{py::cpp_function(refuse)};
    PyDict_SetItemString(type->tp_dict, "__new__", function.ptr());
    PyType_Modified(type);
}

}  // namespace

PYBIND11_MODULE(_palpate, module)
{
    using namespace palpate::python;
    module.doc() = "The C++ side of palpate; import palpate instead.";
    module.attr("build") = std::string(palpate::base::build());
    pybind11::register_exception_translator([](std::exception_ptr pointer) {
        try {
            if (pointer) {
                std::rethrow_exception(pointer);
            }
        } catch (const pybind11::builtin_exception&) {
            throw;  // ValueError and its like are Python's own
        } catch (const std::runtime_error& e) {
            setError(e.what());
        }
    });
    waitAtExit();
    bindVolume(module);
    bindScene(module);
    bindSession(module);
    bindRecord(module);
    bindPlan(module);
#ifdef PALPATE_SWEEP
    bindSweep(module);
#endif
    for (const char* const name : {"Volume", "Scene", "Model", "Session", "Tick", "RecordFile"}) {
        refuseNew(module.attr(name));
    }
    attachDocs(module);
}
