#include "bodies.h"

#include <base/inputs.h>
#include <tests/error_of.h>
#include <tests/folder.h>
#include <volume/export.h>
#include <volume/import.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tests/volume/itk_compiler.h>
#include <unistd.h>

#include <itkImageFileReader.h>
#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>
#include <itkVectorImage.h>
#include <glm/gtc/quaternion.hpp>

#include <cstring>
#include <fstream>
#include <iterator>
#include <random>

namespace palpate::volume {
namespace {

using namespace bodies;
using tests::Folder;

// A label map of any size, spacing, direction, handedness and place, with labels over 255 in every second one.
LabelImage randomImage(std::mt19937& random)
{
    std::uniform_real_distribution<double> any(-1, 1);
    const auto side = [&] { return 2 + static_cast<int>(random() % 17); };
    const Vec3 spacing(0.4e-3 + 0.3e-3 * (1 + any(random)), 1.7e-3 + 1e-3 * any(random), 2.3e-3 + 2e-3 * any(random));
    const glm::dquat turn = glm::normalize(glm::dquat(any(random), any(random), any(random), any(random)));
    Mat3 m = glm::mat3_cast(turn);
    for (int axis = 0; axis < 3; ++axis) {
        m[axis] *= spacing[axis] * (axis == 1 && random() % 2 == 0 ? -1.0 : 1.0);
    }
    const Affine affine{m, 0.3 * Vec3(any(random), any(random), any(random))};
    const bool wide = random() % 2 == 0;
    return voxelise({side(), side(), side()}, affine,
                    [&](Vec3) { return random() % 3 == 0 ? 0U : 1U + random() % 40U * (wide ? 1600U : 1U); });
}

// How far the voxels of two placements are apart [m].
double apart(const Affine& a, const Affine& b, Index3 size)
{
    double most = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3 at = Vec3(size - 1) * Vec3(corner & 1, (corner >> 1) & 1, (corner >> 2) & 1);
        most = std::max(most, glm::length(a.toPatient(at) - b.toPatient(at)));
    }
    return most;
}

struct Way {
    const char* file;
    bool nifti2;
    double precision;  // of positions [m]
};

// NIfTI-1 keeps floats: 24 bits of up to 0.5 m, four numbers of them in a place.
constexpr std::array<Way, 7> ways{{{"a.nii", false, 1.2e-7},
                                   {"a.nii.gz", false, 1.2e-7},
                                   {"a.nii.gz", true, 1e-9},
                                   {"a.nrrd", false, 1e-9},
                                   {"a.seg.nrrd", false, 1e-9},
                                   {"a.mha", false, 1e-9},
                                   {"a.mhd", false, 1e-9}}};

template <typename Image>
typename Image::Pointer readByItk(const std::string& file)
{
    itk::ImageIOBase::Pointer io;
    if (file.find(".nii") != std::string::npos) {
        io = itk::NiftiImageIO::New();
    } else if (file.find(".nrrd") != std::string::npos) {
        io = itk::NrrdImageIO::New();
    } else {
        io = itk::MetaImageIO::New();
    }
    const auto reader = itk::ImageFileReader<Image>::New();
    reader->SetImageIO(io);
    reader->SetFileName(file);
    reader->Update();
    return reader->GetOutput();
}

TEST(Export, WhatIsReadBackIsWhatWasWritten)
{
    const Folder folder;
    std::mt19937 random(8);
    for (int trial = 0; trial < 12; ++trial) {
        const LabelImage image = randomImage(random);
        for (const Way& way : ways) {
            SCOPED_TRACE(fmt::format("{} {}", trial, way.file));
            const std::string file = folder / way.file;
            exportLabels(file, image, names(), {way.nifti2});
            const ImportedLabels back = importLabels(file);
            EXPECT_EQ(back.image.size, image.size);
            EXPECT_EQ(back.image.values, image.values);
            EXPECT_LT(apart(back.image.affine, image.affine, image.size), way.precision);
            // What was read from a file comes back to the bit, whatever the precision of the format.
            exportLabels(file, back.image, names(), {way.nifti2});
            EXPECT_LT(apart(importLabels(file).image.affine, back.image.affine, image.size), 1e-9);
        }
    }
}

Affine affineOf(const itk::Image<std::uint16_t, 3>& image)
{
    Affine affine;
    for (int k = 0; k < 3; ++k) {
        const auto row = static_cast<unsigned>(k);
        affine.origin[k] = 1e-3 * image.GetOrigin()[row];
        for (int axis = 0; axis < 3; ++axis) {
            const auto column = static_cast<unsigned>(axis);
            affine.linear[axis][k] = 1e-3 * image.GetSpacing()[column] * image.GetDirection()(row, column);
        }
    }
    return affine;
}

// ITK's own readers, without our importer around them.
TEST(Export, ItkReadsTheSame)
{
    const Folder folder;
    std::mt19937 random(21);
    for (int trial = 0; trial < 4; ++trial) {
        const LabelImage image = randomImage(random);
        for (const Way& way : ways) {
            if (way.nifti2) {
                continue;  // ITK 5.2 does not know it
            }
            SCOPED_TRACE(way.file);
            const std::string file = folder / way.file;
            exportLabels(file, image, {});
            const auto read = readByItk<itk::Image<std::uint16_t, 3>>(file);
            const Affine affine = affineOf(*read);
            // ITK makes NIfTI's directions of single precision orthogonal again.
            EXPECT_LT(apart(affine, image.affine, image.size), std::max(way.precision, 1e-6 * 1e-3) * 5);
            EXPECT_EQ(0, std::memcmp(read->GetBufferPointer(), image.values.data(), 2 * image.values.size()));
        }
    }
}

// Where the number at `place` of an uncompressed NIfTI-1 file is.
float numberAt(const std::string& bytes, std::size_t place)
{
    float value = 0.0F;
    std::memcpy(&value, bytes.data() + place, sizeof value);
    return value;
}

// Readers may take either placement: the quaternion, by the formula of nifti1.h, says the same as the matrix. In single
// precision its fourth number, the root of what is left of 1, is known to 4e-4 where it is small.
TEST(Export, BothPlacementsOfNiftiAreTheSame)
{
    const Folder folder;
    std::mt19937 random(5);
    for (int trial = 0; trial < 40; ++trial) {
        const std::string file = folder / "a.nii";
        exportLabels(file, randomImage(random), {});
        const std::string bytes = base::contentOf(file).value();
        std::int16_t code = 0;
        std::memcpy(&code, bytes.data() + 252, sizeof code);
        EXPECT_EQ(code, 1);
        const double b = numberAt(bytes, 256), c = numberAt(bytes, 260), d = numberAt(bytes, 264);
        const double a = std::sqrt(std::max(1.0 - b * b - c * c - d * d, 0.0));
        const std::array<std::array<double, 3>, 3> rows{
            {{a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)},
             {2 * (b * c + a * d), a * a + c * c - b * b - d * d, 2 * (c * d - a * b)},
             {2 * (b * d - a * c), 2 * (c * d + a * b), a * a + d * d - b * b - c * c}}};
        for (std::size_t row = 0; row < 3; ++row) {
            for (std::size_t axis = 0; axis < 3; ++axis) {
                const double wide = numberAt(bytes, 80 + 4 * axis) * (axis == 2 ? numberAt(bytes, 76) : 1.0F);
                EXPECT_NEAR(wide * rows[row][axis], numberAt(bytes, 280 + 16 * row + 4 * axis), 1e-3) << trial;
            }
            EXPECT_EQ(numberAt(bytes, 268 + 4 * row), numberAt(bytes, 280 + 16 * row + 12));
        }
    }
}

TEST(Export, NamesColoursAndTermsOfSegmentsAreKept)
{
    const Folder folder;
    LabelImage image = voxelise({9, 8, 7}, {Mat3(1e-3), Vec3(0.0)}, [](Vec3) { return 0; });
    image.values[image.offset({2, 3, 4})] = 5;
    image.values[image.offset({7, 3, 5})] = 5;
    image.values[image.offset({8, 7, 6})] = 200;
    const std::vector<LabelName> named{
        {5, "left \"lung\"", "lung", std::array<std::uint8_t, 3>{12, 255, 0},
         "c~SCT^123037004^Anatomical Structure~SCT^39607008^Lung~SCT^7771000^Left~a~^^~^^"},
        {9, "now\\here", "fat"},
        {200, "M\xc3\xbcller's ]]> \\duct]]>]]\\n</Label>", "duct", std::array<std::uint8_t, 3>{1, 2, 3}, ""}};
    for (const std::string ending : {".seg.nrrd", ".nii.gz"}) {
        SCOPED_TRACE(ending);
        const std::string file = folder / ("s" + ending);
        exportLabels(file, image, named);
        const ImportedLabels back = importLabels(file);
        ASSERT_EQ(back.names.size(), 2U);
        EXPECT_EQ(back.names[0].value, 5);
        EXPECT_EQ(back.names[0].name, named[0].name);
        EXPECT_EQ(back.names[1].value, 200);
        EXPECT_EQ(back.names[1].name, named[2].name);
        if (ending == ".seg.nrrd") {
            EXPECT_EQ(back.names[0].colour, named[0].colour);
            EXPECT_EQ(back.names[1].colour, named[2].colour);
            EXPECT_EQ(back.names[0].terminology, named[0].terminology);
            EXPECT_EQ(back.names[1].terminology, "");
        }
    }
    const std::string text = base::contentOf(folder / "s.seg.nrrd").value();
    EXPECT_NE(text.find("Segment0_Extent:=2 7 3 3 4 5\n"), std::string::npos);
    EXPECT_NE(text.find("Segment1_LabelValue:=200\nSegment1_Layer:=0\n"), std::string::npos);
    EXPECT_EQ(text.find("Segment2"), std::string::npos);
    // slicerio looks all of these up without asking whether they are there.
    for (const char* key :
         {"ID", "Name", "NameAutoGenerated", "Color", "ColorAutoGenerated", "Extent", "LabelValue", "Layer", "Tags"}) {
        EXPECT_NE(text.find(fmt::format("\nSegment0_{}:=", key)), std::string::npos) << key;
        EXPECT_NE(text.find(fmt::format("\nSegment1_{}:=", key)), std::string::npos) << key;
    }
}

// A field that ITK reads as displacements is what a registration program applies.
TEST(Export, ItkReadsVectorsAsTheyWere)
{
    const Folder folder;
    std::mt19937 random(4);
    std::uniform_real_distribution<float> any(-9, 9);
    const VoxelGrid grid{{5, 4, 3}, centred(oblique({1e-3, 2e-3, 3e-3}, Vec3(0.0), false), {5, 4, 3})};
    std::vector<Vec3f> values(60);
    for (Vec3f& v : values) {
        v = Vec3f(any(random), any(random), any(random));
    }
    for (const std::string name : {"u.nii.gz", "u.nrrd", "u.mha"}) {
        SCOPED_TRACE(name);
        exportVectors(folder / name, grid, values);
        const auto read = readByItk<itk::VectorImage<float, 3>>(folder / name);
        ASSERT_EQ(read->GetNumberOfComponentsPerPixel(), 3U);
        EXPECT_EQ(0, std::memcmp(read->GetBufferPointer(), values.data(), sizeof(Vec3f) * values.size()));
    }
    std::vector<float> numbers(60);
    std::generate(numbers.begin(), numbers.end(), [&] { return any(random); });
    exportImage(folder / "i.nii", grid, numbers);
    EXPECT_EQ(importImage(folder / "i.nii").values, numbers);
}

TEST(Export, RefusesOnOneLineAndLeavesNothing)
{
    const Folder folder;
    const LabelImage image = voxelise({3, 3, 3}, {Mat3(1e-3), Vec3(0.0)}, [](Vec3) { return 1; });
    const auto errorOf = [&](const std::string& file) { return tests::errorOf([&] { exportLabels(file, image, {}); }); };
    EXPECT_EQ(errorOf(folder / "a.png"), (folder / "a.png").string() +
                                             ": is no format that is written: name it .nii, .nii.gz, "
                                             ".nrrd, .seg.nrrd, .mha or .mhd");
    EXPECT_NE(errorOf(folder / "no/such/a.nii").find("No such file or directory"), std::string::npos);
    EXPECT_THROW(exportImage(folder / "a.seg.nrrd", {image.size, image.affine}, std::vector<float>(27)),
                 std::runtime_error);
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));

    // The voxels of an .mhd lie beside it, in a file that may be another's.
    std::ofstream(folder / "ct.raw") << "of ct.nhdr";
    EXPECT_NE(errorOf(folder / "ct.mhd").find("is there and belongs to another file"), std::string::npos);
    EXPECT_EQ(std::filesystem::file_size(folder / "ct.raw"), 10U);
    EXPECT_FALSE(std::filesystem::exists(folder / "ct.mhd"));
    std::filesystem::remove(folder / "ct.raw");
    EXPECT_EQ(errorOf(folder / "ct.mhd"), "");
    EXPECT_EQ(errorOf(folder / "ct.mhd"), "") << "its own is replaced";

    // No room for the header, where a folder is: neither part appears.
    std::filesystem::create_directory(folder / fmt::format("b.mhd.{}.part", ::getpid()));
    EXPECT_NE(errorOf(folder / "b.mhd"), "");
    EXPECT_FALSE(std::filesystem::exists(folder / "b.raw"));
    EXPECT_FALSE(std::filesystem::exists(folder / "b.mhd"));
}

// Writers that trusted the grid read past the end of what they were given.
TEST(Export, RefusesValuesThatDoNotFitTheGrid)
{
    const Folder folder;
    LabelImage image = voxelise({3, 3, 3}, {Mat3(1e-3), Vec3(0.0)}, [](Vec3) { return 1; });
    const VoxelGrid grid{image.size, image.affine};
    const NodeGrid nodes{image.size, Vec3(0.0), 1e-3};
    const std::vector<std::uint8_t> tissue(27, 1), tissueShort(26, 1);
    const std::vector<Vec3f> u(27), few(26);
    image.values.pop_back();
    const auto refusedBy = [&](const std::string& name, const auto& write) {
        SCOPED_TRACE(name);
        try {
            write(folder / name);
            ADD_FAILURE() << "was written";
        } catch (const std::runtime_error& e) {
            EXPECT_NE(std::string(e.what()).find(name + ": "), std::string::npos) << e.what();
            EXPECT_NE(std::string(e.what()).find("of 26 values do not fit a grid of 3 x 3 x 3"), std::string::npos)
                << e.what();
        }
    };
    for (const std::string name : {"a.nii", "a.nrrd", "a.seg.nrrd", "a.mha"}) {
        refusedBy(name, [&](const auto& file) { exportLabels(file, image, {}); });
    }
    refusedBy("i.nii", [&](const auto& file) { exportImage(file, grid, std::vector<float>(26)); });
    refusedBy("v.nii", [&](const auto& file) { exportVectors(file, grid, few); });
    refusedBy("t.vtu", [&](const auto& file) { exportVtu(file, nodes, tissueShort, u); });
    refusedBy("u.vtu", [&](const auto& file) { exportVtu(file, nodes, tissue, few); });
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
    exportVtu(folder / "whole.vtu", nodes, tissue, u);
}

TEST(Export, RefusesGridsWithoutVolume)
{
    const tests::Folder folder;
    LabelImage empty, flat;
    flat.size = {2, 2, 2};
    flat.values.assign(8, 1);
    flat.affine.linear = Mat3(0.0);
    for (const char* const name : {"a.nii", "a.nrrd", "a.mha"}) {
        for (const LabelImage& image : {empty, flat}) {
            const std::string why = tests::errorOf([&] { exportLabels(folder / name, image, {}); });
            EXPECT_TRUE(why.starts_with((folder / name).string() + ": ")) << why;
            EXPECT_FALSE(std::filesystem::exists(folder / name));
        }
    }
    EXPECT_THROW(exportImage(folder / "a.nii", {flat.size, flat.affine}, std::vector<float>(8)), std::runtime_error);
}

}  // namespace
}  // namespace palpate::volume
