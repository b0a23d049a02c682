#include <python/scene_box.h>

#include <base/error.h>
#include <datasets/phantom.h>
#include <datasets/tables.h>
#include <report/volume.h>
#include <session/open.h>
#include <volume/image_check.h>
#include <volume/prepare/volume_import.h>

#include <fmt/format.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <tbb/parallel_for.h>
#include <glm/matrix.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace palpate::python {

namespace {

using Path = std::filesystem::path;
using Labels = py::array_t<std::uint16_t, py::array::f_style | py::array::forcecast>;
using Image = py::array_t<float, py::array::f_style | py::array::forcecast>;

std::unique_ptr<VolumeBox> boxed(volume::Tissue tissue, Path file = {})
{
    auto box = std::make_unique<VolumeBox>();
    box->tissue = std::make_shared<const volume::Tissue>(std::move(tissue));
    box->file = std::move(file);
    return box;
}

volume::TissueTable tableOf(const Path& file)
{
    return file.empty() ? datasets::defaultTissues() : datasets::loadTissues(file);
}

std::unique_ptr<VolumeBox> open(const Path& file)
{
    refuseIf(file.empty(), "file: is empty: give a .vdb that palpate wrote");
    const Unlocked others;
    return boxed(session::loadVolume(file), std::filesystem::absolute(file));
}

std::unique_ptr<VolumeBox> phantom(const std::string& name, const py::object& seed, double voxel, const Path& tissues,
                                   const py::kwargs& parameters)
{
    datasets::PhantomSpec spec;
    spec.name = name;
    spec.seed = seedOf(seed, "seed");
    spec.voxel = voxel;
    for (const auto& [key, value] : parameters) {
        const auto parameter = py::str(key).cast<std::string>();
        if (py::isinstance<py::str>(value)) {
            spec.words[parameter] = value.cast<std::string>();
        } else if (const double number = PyFloat_AsDouble(value.ptr()); PyErr_Occurred() == nullptr) {
            spec.numbers[parameter] = number;
        } else {
            PyErr_Clear();
            throw py::type_error(parameter + ": give a number or a word, not " + saidOf(value));
        }
    }
    const Unlocked others;
    return boxed(datasets::makePhantom(spec, tableOf(tissues)));
}

// RAS and LPS differ in the sign of x and y.
volume::Affine affineOf(const py::object& given, const std::string& frame)
{
    constexpr const char* wanted = "give 4 x 4 numbers, voxel index to patient, in metres";
    const Doubles matrix = doublesOf(given, "affine", wanted);
    refuseIf(matrix.ndim() != 2 || matrix.shape(0) != 4 || matrix.shape(1) != 4, "affine: ", wanted);
    refuseIf(frame != "LPS" && frame != "RAS", "frame: is LPS or RAS, not ", frame);
    const auto at = matrix.unchecked<2>();
    for (int column = 0; column < 4; ++column) {
        refuseIf(at(3, column) != (column < 3 ? 0.0 : 1.0), "affine: its last row has to be 0 0 0 1");
    }
    volume::Affine affine;
    for (int row = 0; row < 3; ++row) {
        const double sign = frame == "RAS" && row < 2 ? -1.0 : 1.0;
        for (int column = 0; column < 3; ++column) {
            affine.linear[column][row] = sign * at(row, column);
        }
        affine.origin[row] = sign * at(row, 3);
    }
    return affine;
}

// The importer refuses sheared labels, too: fields on them assume axes at right angles.
void checkGrid(const volume::LabelImage& map)
{
    try {
        volume::checkImage(map);
    } catch (const std::runtime_error& e) {
        throw py::value_error(std::string("labels, affine: ") + e.what());
    }
    if (std::sin(volume::shearOf(map.affine)) > volume::maxShear) {
        throw py::value_error(
            "affine: its axes are not at right angles to each other: resample the labels to a straight grid");
    }
}

py::array_t<double> matrixOf(const volume::Affine& affine)
{
    py::array_t<double> out({4, 4});
    auto at = out.mutable_unchecked<2>();
    for (int row = 0; row < 4; ++row) {
        for (int column = 0; column < 3; ++column) {
            at(row, column) = row < 3 ? affine.linear[column][row] : 0.0;
        }
        at(row, 3) = row < 3 ? affine.origin[row] : 1.0;
    }
    return out;
}

// The name of a structure, as files and messages can have it: on one line.
void checkName(const volume::LabelName& label)
{
    const std::string where = fmt::format("tissues: label {}", label.value);
    refuseIf(label.name.find_first_not_of(' ') == std::string::npos, where, ": its name is empty");
    for (std::size_t at = 0; at < label.name.size(); ++at) {
        const auto byte = [&](std::size_t i) {
            return i < label.name.size() ? static_cast<unsigned char>(label.name[i]) : 0;
        };
        const bool second = byte(at) == 0xc2 && byte(at + 1) < 0xa0;  // U+0080 to U+009F in UTF-8
        refuseIf(byte(at) < 0x20 || byte(at) == 0x7f || second, where, ": its name holds a control character");
    }
}

// {value: "tissue"} or {value: ("name", "tissue")}.
std::vector<volume::LabelName> namesOf(const py::dict& tissues)
{
    std::vector<volume::LabelName> names;
    for (const auto& [value, said] : tissues) {
        volume::LabelName name;
        try {
            name.value = value.cast<std::uint16_t>();
        } catch (const py::cast_error&) {
            throw py::value_error("tissues: keys are label values, 0 to 65535, not " + saidOf(value));
        }
        if (py::isinstance<py::str>(said)) {
            name.name = name.tissue = said.cast<std::string>();
        } else {
            try {
                std::tie(name.name, name.tissue) = said.cast<std::pair<std::string, std::string>>();
            } catch (const py::cast_error&) {
                throw py::value_error("tissues: label " + std::to_string(name.value) +
                                      ": give a tissue or (structure's name, tissue), not " + saidOf(said));
            }
        }
        checkName(name);
        // Labels that are called by their tissue may share that.
        const auto same = std::ranges::find(names, name.name, &volume::LabelName::name);
        if (same != names.end() && (same->tissue != name.name || name.tissue != name.name)) {
            throw py::value_error(fmt::format("tissues: labels {} and {} are both called '{}': give each its own name",
                                              same->value, name.value, name.name));
        }
        names.push_back(std::move(name));
    }
    return names;
}

// An array of what Python's caller gave. One with a mask is refused: its masked values would count.
py::array arrayOf(const py::object& what, const char* name)
{
    const py::object masked = py::module_::import("numpy").attr("ma").attr("MaskedArray");
    refuseIf(py::isinstance(what, masked), name, ": give an array without a mask: fill its masked values (filled)");
    auto array = py::array::ensure(what);
    if (!array) {
        PyErr_Clear();
        throw py::value_error(std::string(name) + ": give an array of numbers");
    }
    return array;
}

Labels labelArray(const py::array& given)
{
    const char kind = given.dtype().kind();
    if (kind != 'u' && kind != 'i' && kind != 'b') {
        throw py::value_error("labels: give an array of whole numbers, not of " +
                              py::str(given.dtype()).cast<std::string>());
    }
    refuseIf(given.ndim() != 3, "labels: give an array of three dimensions, indexed (i, j, k)");
    if (given.size() > 0 && kind != 'b') {
        // Of any width, 64 bits with or without a sign.
        const py::object low = given.attr("min")(), high = given.attr("max")();
        if (low.cast<double>() < 0 || high.cast<double>() > std::numeric_limits<std::uint16_t>::max()) {
            throw py::value_error("labels: values are 0 to 65535, and here " + py::str(low).cast<std::string>() + " to " +
                                  py::str(high).cast<std::string>());
        }
    }
    return Labels(given);
}

Image imageArray(const py::array& given)
{
    const bool isNumbers = holdsNumbers(given);
    auto values = isNumbers ? Image::ensure(given) : Image();
    if (!isNumbers || !values) {
        PyErr_Clear();
        throw py::value_error("image: give an array of numbers, not of " + py::str(given.dtype()).cast<std::string>());
    }
    return values;
}

// A unit that is only nearly HU would leave out every check that is made of Hounsfield units.
void checkUnit(const std::string& unit)
{
    refuseIf(!unit.empty() && unit != "HU", "image_unit: must be \"HU\", or \"\" for an image without a unit");
}

std::unique_ptr<VolumeBox> fromNumpy(const py::object& given, const py::object& affine, const py::dict& tissues,
                                     const py::object& image, const std::string& unit, const std::string& frame,
                                     const Path& table)
{
    const Labels labels = labelArray(arrayOf(given, "labels"));
    volume::LabelImage map;
    map.size = {static_cast<int>(labels.shape(0)), static_cast<int>(labels.shape(1)), static_cast<int>(labels.shape(2))};
    map.affine = affineOf(affine, frame);
    map.values.assign(labels.data(), labels.data() + labels.size());
    checkGrid(map);
    std::optional<volume::CompanionImage> companion;
    refuseIf(image.is_none() && !unit.empty(), "image_unit: needs the image: give image too");
    if (!image.is_none()) {
        const Image values = imageArray(arrayOf(image, "image"));
        refuseIf(values.ndim() != 3 || !std::equal(values.shape(), values.shape() + 3, labels.shape()),
                 "image: has to have the shape of the labels");
        checkUnit(unit);
        companion.emplace();
        companion->unit = unit;
        companion->values.assign(values.data(), values.data() + values.size());
        refuseIf(!std::ranges::all_of(companion->values, [](float v) { return std::isfinite(v); }),
                 "image: has values that are not finite: give each voxel a number, e.g. with numpy.nan_to_num");
    }
    const auto names = namesOf(tissues);
    const bool anyTissue = std::ranges::any_of(map.values, [](std::uint16_t label) { return label != 0; }) ||
                           std::ranges::find(names, 0, &volume::LabelName::value) != names.end();
    refuseIf(!anyTissue, "labels: no voxel is set: every label is 0, give an array that holds something");
    const Unlocked others;
    return boxed(
        volume::Tissue::fromLabels(map, tableOf(table), names, {{"source", "numpy"}}, companion ? &*companion : nullptr));
}

py::array gridView(const py::object& self, const py::dtype& type, const void* data)
{
    const Index3 size = self.cast<VolumeBox&>().tissue->size();
    const py::ssize_t item = type.itemsize();
    return readOnlyView(type, {size.x, size.y, size.z}, {item, item * size.x, item * size.x * size.y}, data, self);
}

py::object imageOf(const py::object& self)
{
    auto& box = self.cast<VolumeBox&>();
    return box.tissue->hasImage() ? py::object(gridView(self, py::dtype::of<float>(), box.dense->image(*box.tissue).data()))
                                  : py::none();
}

py::dict provenanceOf(const VolumeBox& box)
{
    py::dict out;
    for (const auto& [key, value] : box.tissue->provenance()) {
        if (!out.contains(key)) {
            out[py::str(key)] = py::list();
        }
        out[py::str(key)].cast<py::list>().append(textOf(value));
    }
    return out;
}

py::list tissuesOf(const VolumeBox& box)
{
    py::list out;
    for (const volume::TissueRow& row : box.tissue->table().rows) {
        py::dict one;
        one["name"] = row.name;
        one["role"] = std::string(volume::name(row.role));
        one["youngs_modulus"] = row.youngsModulus;
        one["poisson_ratio"] = row.poissonRatio;
        one["density"] = row.density;
        one["puncture_force"] = row.punctureForce;
        one["fixed"] = row.fixed;
        one["source"] = row.source;
        out.append(one);
    }
    return out;
}

std::unique_ptr<VolumeBox> import(const Path& path, const py::object& set, const std::string& map,
                                  const std::string& defaultTissue, const Path& image, const std::string& imageUnit,
                                  const std::string& imageSeries, bool ignoreFrame, const std::string& stiffnessFrom,
                                  double voxel, bool bodyFromImage, double bodyFromHull, const Path& tissues)
{
    refuseIf(path.empty(), "path: is empty: give a file or a folder");
    checkUnit(imageUnit);
    prepare::ImportRequest request;
    request.input = path;
    request.mapping.map = map;
    request.mapping.defaultTissue = defaultTissue;
    for (const auto& [label, tissue] : dictOf(set, "set")) {
        const std::string name = wordOf(py::str(label), "set");
        request.mapping.set.push_back(name + "=" + wordOf(tissue, ("set: label " + name).c_str()));
    }
    request.image = image;
    request.imageUnit = imageUnit;
    request.imageSeries = imageSeries;
    request.ignoreFrame = ignoreFrame;
    request.stiffness = stiffnessFrom;
    request.steps.voxel = voxel;
    request.reading.sheared = voxel > 0;
    request.bodyFromImage = bodyFromImage;
    request.hull = bodyFromHull;
    const Unlocked others;
    return boxed(prepare::importVolume(request, tableOf(tissues), [](const std::string&, std::optional<double>) {}).tissue);
}

}  // namespace

const std::vector<std::uint16_t>& DenseGrids::labels(const volume::Tissue& tissue)
{
    const std::lock_guard lock(making_);
    if (!labels_) {
        labels_ = tissue.labels().values;
    }
    return *labels_;
}

const std::vector<float>& DenseGrids::stiffness(const volume::Tissue& tissue)
{
    const std::lock_guard lock(making_);
    if (!stiffness_) {
        const Index3 size = tissue.size();
        volume::LabelImage at;
        at.size = size;
        std::vector<float> values(at.offset({0, 0, size.z}));
        tbb::parallel_for(0, size.z, [&](int z) {
            const volume::Tissue::Reader reader(tissue);
            volume::forEachIndex({0, 0, z}, {size.x - 1, size.y - 1, z}, [&](Index3 n) {
                values[at.offset(n)] = static_cast<float>(reader.youngsModulus(tissue.affine().toPatient(Vec3(n))));
            });
        });
        stiffness_ = std::move(values);
    }
    return *stiffness_;
}

const std::vector<float>& DenseGrids::image(const volume::Tissue& tissue)
{
    const std::lock_guard lock(making_);
    if (!image_) {
        auto companion = tissue.companion();
        image_ = companion ? std::move(companion->values) : std::vector<float>();
    }
    return *image_;
}

void bindVolume(py::module_& module)
{
    const char* const none = "";  // an empty path of Python would be "."
    py::class_<VolumeBox>(module, "Volume")
        .def_static("open", &open, py::arg("file"))
        .def_static("import_", &import, py::arg("path"), py::kw_only(), py::arg("set") = py::dict(), py::arg("map") = "",
                    py::arg("default_tissue") = "", py::arg("image") = none, py::arg("image_unit") = "",
                    py::arg("image_series") = "", py::arg("ignore_frame_of_reference") = false,
                    py::arg("stiffness_from") = "", py::arg("voxel") = 0.0, py::arg("body_from_image") = false,
                    py::arg("body_from_hull") = 0.0, py::arg("tissues") = none)
        .def_static("phantom", &phantom, py::arg("name") = "breast", py::arg("seed") = 1, py::arg("voxel") = 1e-3,
                    py::arg("tissues") = none)
        .def_static("from_numpy", &fromNumpy, py::arg("labels"), py::arg("affine"), py::arg("tissues"), py::kw_only(),
                    py::arg("image") = py::none(), py::arg("image_unit") = "", py::arg("frame") = "LPS",
                    py::arg("table") = none)
        .def(
            "save",
            [](VolumeBox& box, const Path& file) {
                refuseIf(file.empty(), "file: is empty: give a name that ends in .vdb");
                base::failIf(file.extension() != ".vdb", "{}: a volume is a .vdb file: name it so", file.native());
                {
                    const Unlocked others;
                    box.tissue->save(file);
                }
                box.file = std::filesystem::absolute(file);
            },
            py::arg("file"))
        .def_property_readonly("labels",
                               [](const py::object& self) {
                                   const auto& box = self.cast<VolumeBox&>();
                                   return gridView(self, py::dtype::of<std::uint16_t>(),
                                                   box.dense->labels(*box.tissue).data());
                               })
        .def_property_readonly("stiffness",
                               [](const py::object& self) {
                                   const auto& box = self.cast<VolumeBox&>();
                                   return gridView(self, py::dtype::of<float>(), box.dense->stiffness(*box.tissue).data());
                               })
        .def_property_readonly("image", &imageOf)
        .def_property_readonly("image_unit", [](const VolumeBox& box) { return box.tissue->imageUnit(); })
        .def_property_readonly("shape",
                               [](const VolumeBox& box) {
                                   const Index3 size = box.tissue->size();
                                   return py::make_tuple(size.x, size.y, size.z);
                               })
        .def_property_readonly("affine", [](const VolumeBox& box) { return matrixOf(box.tissue->affine()); })
        .def_property_readonly("spacing", [](const VolumeBox& box) { return vectorOf(box.tissue->affine().spacing()); })
        .def_property_readonly("info", [](const VolumeBox& box) { return toPython(report::volumeFigures(*box.tissue)); })
        .def_property_readonly("provenance", &provenanceOf)
        .def_property_readonly("tissues", &tissuesOf)
        .def_property_readonly("file", [](const VolumeBox& box) -> py::object {
            return box.file.empty() ? py::object(py::none()) : py::object(textOf(box.file.native()));
        });
    module.def("phantoms", &datasets::phantomNames);
}

}  // namespace palpate::python
