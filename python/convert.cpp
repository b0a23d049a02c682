#include <python/convert.h>

#include <nlohmann/json.hpp>

#include <cstdint>

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

Vec3 vec3Of(const py::handle& value, const char* what)
{
    const auto array = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(value);
    if (!array || array.ndim() != 1 || array.shape(0) != 3) {
        PyErr_Clear();
        throw py::value_error(std::string(what) + ": give three numbers");
    }
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
                out[py::str(key)] = toPython(value);
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
            return py::str(figures.get<std::string>());
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

void throwSceneError(const std::string& message)
{
    py::object error = py::module_::import("palpate._errors").attr("scene_error")(message);
    PyErr_SetObject(py::type::of(error).ptr(), error.ptr());
    throw py::error_already_set();
}

}  // namespace palpate::python
