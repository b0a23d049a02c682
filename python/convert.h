#pragma once

// What all bindings share: vectors, errors, arrays that look into memory of ours.

#include <volume/geometry.h>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <nlohmann/json_fwd.hpp>

#include <string>
#include <vector>

namespace palpate::python {

namespace py = pybind11;

/// Throws ValueError if `wrong`: the parts of its text in a row.
template <typename... Parts>
void refuseIf(bool wrong, const Parts&... why)
{
    if (wrong) {
        throw py::value_error((std::string() + ... + why));
    }
}

/// A numpy vector of three [as `v`].
py::array_t<double> vectorOf(Vec3 v);

/// Any sequence of three numbers. Throws ValueError that names `what`.
Vec3 vec3Of(const py::handle& value, const char* what);

/// An array that looks at `data` without a copy and cannot be written to; `owner` lives as long as any view of it.
/// @param strides  in bytes
py::array readOnlyView(const py::dtype& type, std::vector<py::ssize_t> shape, std::vector<py::ssize_t> strides,
                       const void* data, const py::object& owner);

/// Dictionaries, lists, numbers and words of Python.
py::object toPython(const nlohmann::json& figures);

/// Takes apart "FILE:LINE: [section] key = value: what is wrong" and throws palpate.SceneError, a ValueError with the
/// attributes file, line, key.
[[noreturn]] void throwSceneError(const std::string& message);

void bindVolume(py::module_& module);
void bindScene(py::module_& module);
void bindSession(py::module_& module);
void bindRecord(py::module_& module);
void bindPlan(py::module_& module);
void bindSweep(py::module_& module);
/// Gives everything the text that palpate/_palpate.pyi has of it. Throws where that names what is not there.
void attachDocs(py::module_& module);

}  // namespace palpate::python
