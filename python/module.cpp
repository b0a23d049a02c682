#include <base/build.h>
#include <python/convert.h>

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
    attachDocs(module);
}
