#pragma once

// What all bindings share: vectors, errors, arrays that look into memory of ours.

#include <python/unlocked.h>
#include <volume/geometry.h>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
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

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// Whether an array is of numbers or of objects that may be numbers, and not of words or complex numbers.
bool holdsNumbers(const py::array& array);

/// Numbers as Python's caller gave them, none of which are words or masked. Throws ValueError("NAME: WANTED").
Doubles doublesOf(const py::handle& given, const char* name, const char* wanted);
/// Throws ValueError if it is an array with a mask: what that hides would be taken for numbers.
void refuseMasked(const py::handle& given, const std::string& name);
/// A whole number from 0 to 2**64 - 1. Throws ValueError or TypeError that names it.
std::uint64_t seedOf(const py::handle& given, const char* name);
/// A str of Python in UTF-8. Throws ValueError or TypeError that names it.
std::string wordOf(const py::handle& given, const char* name);
/// What an error says of a value that is refused, on one line: "'3' (str)".
std::string saidOf(const py::handle& given);
/// A dict, or a mapping as one. Throws TypeError that names it.
py::dict dictOf(const py::object& given, const char* name);
/// What os.fspath() makes of it. Throws ValueError or TypeError that names it.
std::filesystem::path pathOf(const py::handle& given, const char* name);
/// Text of C++, which may hold the names of files, as Python has those: what is no UTF-8 as surrogates.
py::str textOf(std::string_view text);

/// Any sequence of three numbers. Throws ValueError that names `what`.
Vec3 vec3Of(const py::handle& value, const char* what);

/// An array that looks at `data` without a copy and cannot be written to; `owner` lives as long as any view of it.
/// @param strides  in bytes
py::array readOnlyView(const py::dtype& type, std::vector<py::ssize_t> shape, std::vector<py::ssize_t> strides,
                       const void* data, const py::object& owner);

/// Dictionaries, lists, numbers and words of Python.
py::object toPython(const nlohmann::json& figures);

/// Sets palpate.Error, with the arguments of Python for a program's options.
void setError(const std::string& message);

/// Takes apart "FILE:LINE: [section] key = value: what is wrong" and throws palpate.SceneError, a ValueError with the
/// attributes file, line, key.
[[noreturn]] void throwSceneError(const std::string& message);
/// What a scene's volume or model says while it is made: palpate.SceneError where a place or a key of the scene is at
/// fault, palpate.Error otherwise.
[[noreturn]] void throwModelError(const std::string& message);

void bindVolume(py::module_& module);
void bindScene(py::module_& module);
void bindSession(py::module_& module);
void bindRecord(py::module_& module);
void bindPlan(py::module_& module);
void bindSweep(py::module_& module);
/// Gives everything the text that palpate/_palpate.pyi has of it, and functions explainedCall(). Throws where that names
/// what is not there.
void attachDocs(py::module_& module);

}  // namespace palpate::python
