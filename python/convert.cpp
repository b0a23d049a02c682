#include <python/convert.h>

#include <nlohmann/json.hpp>

#include <cstdint>
#include <new>
#include <stdexcept>

namespace palpate::python {

py::array_t<double> vectorOf(Vec3 v)
{
    py::array_t<double> out(3);
    auto at = out.mutable_unchecked<1>();
    at(0) = v.x;
    at(1) = v.y;
    at(2) = v.z;
    return out;
}

void refuseMasked(const py::handle& given, const std::string& name)
{
    // numpy.ma alone adds this to an array.
    const bool masked = py::isinstance<py::array>(given) && py::hasattr(given, "mask");
    refuseIf(masked, name, ": is a masked array: give a plain one, such as its filled()");
}

bool holdsNumbers(const py::array& array)
{
    return std::string_view("biufO").find(array.dtype().kind()) != std::string_view::npos;
}

Doubles doublesOf(const py::handle& given, const char* name, const char* wanted)
{
    refuseMasked(given, name);
    const auto array = py::array::ensure(given);
    const bool isNumbers = array && holdsNumbers(array);
    auto numbers = isNumbers ? Doubles::ensure(array) : Doubles();
    if (isNumbers && !numbers && array.dtype().kind() != 'O') {
        throw std::bad_alloc();  // nothing else can go wrong with numbers
    }
    if (!isNumbers || !numbers) {
        PyErr_Clear();
        throw py::value_error(std::string(name) + ": " + wanted);
    }
    return numbers;
}

std::uint64_t seedOf(const py::handle& given, const char* name)
{
    const auto whole = py::reinterpret_steal<py::object>(PyNumber_Index(given.ptr()));
    if (!whole) {
        PyErr_Clear();
        throw py::type_error(std::string(name) + ": give a whole number, not " + saidOf(given));
    }
    const std::uint64_t value = PyLong_AsUnsignedLongLong(whole.ptr());
    if (PyErr_Occurred() != nullptr) {
        PyErr_Clear();
        throw py::value_error(std::string(name) + ": give a whole number from 0 to 2**64 - 1");
    }
    return value;
}

std::string wordOf(const py::handle& given, const char* name)
{
    if (!py::isinstance<py::str>(given)) {
        throw py::type_error(std::string(name) + ": give a word (str), not " + saidOf(given));
    }
    Py_ssize_t size = 0;
    const char* const utf8 = PyUnicode_AsUTF8AndSize(given.ptr(), &size);
    if (utf8 == nullptr) {
        PyErr_Clear();
        throw py::value_error(std::string(name) + ": holds half a character (surrogates)");
    }
    std::string word{utf8, static_cast<std::size_t>(size)};
    refuseIf(word.find('\0') != std::string::npos, name, ": holds a NUL character");
    return word;
}

std::string saidOf(const py::handle& given)
{
    return py::module_::import("palpate._arguments").attr("said")(given).cast<std::string>();
}

py::dict dictOf(const py::object& given, const char* name)
{
    if (!py::isinstance<py::dict>(given) && !py::hasattr(given, "keys")) {
        throw py::type_error(std::string(name) + ": give a dict, not " + saidOf(given));
    }
    return py::dict(given);
}

std::filesystem::path pathOf(const py::handle& given, const char* name)
{
    PyObject* bytes = nullptr;
    if (PyUnicode_FSConverter(given.ptr(), &bytes) == 0) {
        const bool isPath = PyErr_ExceptionMatches(PyExc_ValueError) != 0;
        PyErr_Clear();
        refuseIf(isPath, name, ": holds a NUL, or half a character");
        throw py::type_error(std::string(name) + ": give a file, not " + saidOf(given));
    }
    const auto owned = py::reinterpret_steal<py::bytes>(bytes);
    return std::filesystem::path(std::string(owned));
}

py::str textOf(std::string_view text)
{
    PyObject* const decoded = PyUnicode_DecodeFSDefaultAndSize(text.data(), static_cast<Py_ssize_t>(text.size()));
    if (decoded == nullptr) {
        throw py::error_already_set();
    }
    return py::reinterpret_steal<py::str>(decoded);
}

Vec3 vec3Of(const py::handle& value, const char* what)
{
    constexpr const char* wanted = "give three numbers";
    const Doubles array = doublesOf(value, what, wanted);
    refuseIf(array.ndim() != 1 || array.shape(0) != 3, what, ": ", wanted);
    return {array.data()[0], array.data()[1], array.data()[2]};
}

py::array readOnlyView(const py::dtype& type, std::vector<py::ssize_t> shape, std::vector<py::ssize_t> strides,
                       const void* data, const py::object& owner)
{
    py::array view(type, std::move(shape), std::move(strides), data, owner);
    py::detail::array_proxy(view.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
    return view;
}

py::object toPython(const nlohmann::json& figures)
{
    switch (figures.type()) {
        case nlohmann::json::value_t::object: {
            py::dict out;
            for (const auto& [key, value] : figures.items()) {
                out[textOf(key)] = toPython(value);
            }
            return out;
        }
        case nlohmann::json::value_t::array: {
            py::list out;
            for (const nlohmann::json& value : figures) {
                out.append(toPython(value));
            }
            return out;
        }
        case nlohmann::json::value_t::string:
            return textOf(figures.get_ref<const std::string&>());
        case nlohmann::json::value_t::boolean:
            return py::bool_(figures.get<bool>());
        case nlohmann::json::value_t::number_integer:
            return py::int_(figures.get<std::int64_t>());
        case nlohmann::json::value_t::number_unsigned:
            return py::int_(figures.get<std::uint64_t>());
        case nlohmann::json::value_t::number_float:
            return py::float_(figures.get<double>());
        default:
            return py::none();
    }
}

void setError(const std::string& message)
{
    const py::object errors = py::module_::import("palpate._errors");
    PyErr_SetObject(errors.attr("Error").ptr(), py::object(errors.attr("in_python")(textOf(message))).ptr());
}

// Throws what a function of palpate._errors makes of the message.
[[noreturn]] static void throwMadeBy(const char* function, const std::string& message)
{
    py::object error = py::module_::import("palpate._errors").attr(function)(textOf(message));
    PyErr_SetObject(py::type::of(error).ptr(), error.ptr());
    throw py::error_already_set();
}

void throwSceneError(const std::string& message)
{
    throwMadeBy("scene_error", message);
}

void throwModelError(const std::string& message)
{
    throwMadeBy("model_error", message);
}

}  // namespace palpate::python
