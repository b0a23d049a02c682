// NRRD files made here: every encoding, every order of axes, layers of segments that overlap.
#include <tests/error_of.h>
#include <tests/folder.h>
#include <tests/volume/files.h>
#include <volume/import.h>

#include <bzlib.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <zlib.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <fstream>
#include <random>

namespace palpate::volume {
namespace {

namespace fs = std::filesystem;

class Nrrd : public ::testing::Test {
protected:
    fs::path write(const std::string& name, const std::string& bytes) const
    {
        std::ofstream(folder / name, std::ios::binary) << bytes;
        return folder / name;
    }
    std::string reason(const std::string& bytes, const ImportOptions& options = {}) const
    {
        return tests::errorOf([&] { importLabels(write("a.nrrd", bytes), options); });
    }

    const tests::Folder folder;
};

std::vector<std::uint16_t> ramp()
{
    std::vector<std::uint16_t> values(4 * 5 * 6);
    for (std::size_t i = 0; i < values.size(); ++i) {
        values[i] = static_cast<std::uint16_t>(i * 7 % 300);
    }
    return values;
}

std::string bzip2(std::string plain)
{
    std::string packed(plain.size() + 1000, '\0');
    auto size = static_cast<unsigned>(packed.size());
    BZ2_bzBuffToBuffCompress(packed.data(), &size, plain.data(), static_cast<unsigned>(plain.size()), 9, 0, 0);
    packed.resize(size);
    return packed;
}

std::string text(const std::vector<std::uint16_t>& values)
{
    std::string out;
    for (std::size_t i = 0; i < values.size(); ++i) {
        out += fmt::format("{}{}", values[i], i % 4 == 3 ? "\n" : " ");
    }
    return out;
}

std::string hex(const std::string& bytes)
{
    std::string out;
    for (const char c : bytes) {
        out += fmt::format("{:02X}{}", static_cast<int>(static_cast<unsigned char>(c)), out.size() % 70 == 0 ? "\n" : "");
    }
    return out;
}

std::string head(const std::string& encoding, const std::string& more = "")
{
    return fmt::format(
        "NRRD0004\n# a comment\ntype: unsigned short\ndimension: 3\nspace: left-posterior-superior\nsizes: 4 5 6\n"
        "space directions: (1,0,0) (0,2,0) (0,0,3)\nspace origin: (10,20,30)\nendian: little\n{}encoding: {}\n\n",
        more, encoding);
}

TEST_F(Nrrd, EveryEncodingGivesTheSameLabels)
{
    const std::string raw = bytesOf(ramp());
    const std::array<std::pair<const char*, std::string>, 6> files = {{{"raw", raw},
                                                                       {"bzip2", bzip2(raw)},
                                                                       {"bz2", bzip2(raw)},
                                                                       {"ascii", text(ramp())},
                                                                       {"txt", text(ramp())},
                                                                       {"hex", hex(raw)}}};
    for (const auto& [encoding, data] : files) {
        const ImportedLabels labels = importLabels(write("a.nrrd", head(encoding) + data));
        EXPECT_EQ(labels.image.values, ramp()) << encoding;
        EXPECT_TRUE(labels.warnings.empty()) << encoding;
        EXPECT_NEAR(glm::length(labels.image.affine.toPatient({1, 1, 1}) - Vec3(11e-3, 22e-3, 33e-3)), 0, 1e-12);
    }
    EXPECT_NE(reason(head("bzip2") + raw).find("not compressed in that way"), std::string::npos);
    EXPECT_NE(reason(head("ascii") + text(ramp()).substr(0, 200)).find("numbers"), std::string::npos);
    EXPECT_NE(reason(head("ascii") + text(ramp()) + " 12 13").find("its header is wrong"), std::string::npos);
    EXPECT_NE(reason(head("ascii") + "12 hello 13").find("'hello' is no number"), std::string::npos);
    EXPECT_NE(reason(head("hex") + "12 3g").find("hexadecimal"), std::string::npos);
    EXPECT_NE(reason(head("lzma") + raw).find("encoding: 'lzma'"), std::string::npos);
    EXPECT_NE(reason(head("bzip2") + bzip2(raw).substr(0, 60)).find("end too early"), std::string::npos);
}

// line skip counts in the file, byte skip in what is unpacked; -1 takes the last bytes.
TEST_F(Nrrd, SkipsLinesAndBytes)
{
    const std::string raw = bytesOf(ramp());
    for (const std::string encoding : {"raw", "bzip2"}) {
        const auto packed = [&](const std::string& bytes) { return encoding == "raw" ? bytes : bzip2(bytes); };
        const std::string junk = "0123456789";
        EXPECT_EQ(importLabels(write("a.nrrd", head(encoding, "byte skip: 10\n") + packed(junk + raw))).image.values,
                  ramp());
        EXPECT_EQ(importLabels(write("a.nrrd", head(encoding, "byte skip: -1\n") + packed(junk + raw))).image.values,
                  ramp());
        EXPECT_EQ(importLabels(write("a.nrrd", head(encoding, "line skip: 2\n") + "one\ntwo\n" + packed(raw))).image.values,
                  ramp());
    }
    write("beside.raw", "title\n" + raw);
    const std::string detached = head("raw", "line skip: 1\ndata file: beside.raw\n");
    EXPECT_EQ(importLabels(write("a.nhdr", detached)).image.values, ramp());
    EXPECT_NE(reason(head("raw", "data file: gone.raw\n")).find("gone.raw is not there"), std::string::npos);
    EXPECT_NE(reason(head("raw", "data file: s%03d.raw 1 6 1\n")).find("one file each"), std::string::npos);
}

// Units, spaces and headers that say less.
TEST_F(Nrrd, WhatTheHeaderLeavesOpenIsAssumedAndSaid)
{
    const std::string raw = bytesOf(ramp());
    const std::string bare = "NRRD0001\ntype: uint16\ndimension: 3\nsizes: 4 5 6\nencoding: raw\n";
    const ImportedLabels none = importLabels(write("a.nrrd", bare + "\n" + raw));
    ASSERT_EQ(none.warnings.size(), 3U);  // space, spacing, endian
    EXPECT_NEAR(glm::length(none.image.affine.linear[1] - Vec3(0, 1e-3, 0)), 0, 1e-15);
    const ImportedLabels spaced = importLabels(write("a.nrrd", bare + "endian: little\nspacings: 1 2 3\n\n" + raw));
    ASSERT_EQ(spaced.warnings.size(), 1U);
    EXPECT_NEAR(spaced.image.affine.linear[2].z, 3e-3, 1e-15);
    const ImportedLabels part = importLabels(write("a.nrrd", bare + "endian: little\nspacings: 2 nan nan\n\n" + raw));
    ASSERT_EQ(part.warnings.size(), 2U);
    EXPECT_TRUE(std::ranges::any_of(part.warnings, [](const std::string& w) {
        return w.find("no spacing along y and z: 1 mm is assumed") != std::string::npos;
    }));
    EXPECT_EQ(part.image.affine.spacing(), Vec3(2e-3, 1e-3, 1e-3));
    const ImportedLabels scanner = importLabels(
        write("a.nrrd", bare +
                            "endian: little\nspace: RAS\nspace units: \"um\" \"um\" \"um\"\n"
                            "space directions: (0, 1000, 0) (1000, 0, 0) (0, 0, 1000)\nspace origin: (1000,2000,3000)\n\n" +
                            raw));
    EXPECT_NEAR(glm::length(scanner.image.affine.linear[0] - Vec3(0, -1e-3, 0)), 0, 1e-15);
    EXPECT_NEAR(glm::length(scanner.image.affine.origin - Vec3(-1e-3, -2e-3, 3e-3)), 0, 1e-15);
    EXPECT_NE(reason(bare + "space units: \"mm\" \"mm\" \"inch\"\n\n" + raw).find("space units"), std::string::npos);
    EXPECT_NE(reason(bare + "sizes: 4 5 6\n\n" + raw).find("gives 'sizes' twice"), std::string::npos);
    EXPECT_NE(reason(bare + "kinds: domain domain\n\n" + raw).find("2 entries for 3 axes"), std::string::npos);
}

// Three segments in two layers: "small" lies inside "large", "other" touches both.
struct Layers {
    std::vector<std::uint8_t> first = std::vector<std::uint8_t>(120, 0);   // 1 large: voxels 0..59, 2 other: 60..69
    std::vector<std::uint8_t> second = std::vector<std::uint8_t>(120, 0);  // 1 small: voxels 50..64

    Layers()
    {
        std::fill_n(first.begin(), 60, std::uint8_t{1});
        std::fill_n(first.begin() + 60, 10, std::uint8_t{2});
        std::fill_n(second.begin() + 50, 15, std::uint8_t{1});
    }
    // The list of layers as axis `axis` of four.
    std::string file(std::size_t axis) const
    {
        std::vector<std::size_t> sizes = {4, 5, 6};
        std::vector<std::string> directions = {"(1,0,0)", "(0,1,0)", "(0,0,1)"}, kinds(3, "domain");
        sizes.insert(sizes.begin() + static_cast<std::ptrdiff_t>(axis), 2);
        directions.insert(directions.begin() + static_cast<std::ptrdiff_t>(axis), "none");
        kinds.insert(kinds.begin() + static_cast<std::ptrdiff_t>(axis), "list");
        std::size_t inner = 1;
        for (std::size_t i = 0; i < axis; ++i) {
            inner *= sizes[i];
        }
        std::string data;
        for (std::size_t block = 0; block < 120; block += inner) {
            data.append(first.begin() + static_cast<std::ptrdiff_t>(block),
                        first.begin() + static_cast<std::ptrdiff_t>(block + inner));
            data.append(second.begin() + static_cast<std::ptrdiff_t>(block),
                        second.begin() + static_cast<std::ptrdiff_t>(block + inner));
        }
        return fmt::format(
                   "NRRD0004\ntype: uchar\ndimension: 4\nspace: LPS\nsizes: {}\nspace directions: {}\nkinds: {}\nencoding: "
                   "raw\n"
                   "space origin: (0,0,0)\n"
                   "Segment0_ID:=a\nSegment0_Name:=large\nSegment0_LabelValue:=1\nSegment0_Layer:=0\nSegment0_Color:=1 0 "
                   "0.5\n"
                   "Segment1_ID:=b\nSegment1_Name:=other\nSegment1_LabelValue:=2\nSegment1_Layer:=0\n"
                   "Segment2_ID:=c\nSegment2_Name:=small\nSegment2_LabelValue:=1\nSegment2_Layer:=1\n\n",
                   fmt::join(sizes, " "), fmt::join(directions, " "), fmt::join(kinds, " ")) +
               data;
    }
};

// Voxels that `name` has in the end.
std::size_t kept(const ImportedLabels& labels, const std::string& name)
{
    const auto found =
        std::find_if(labels.names.begin(), labels.names.end(), [&](const LabelName& n) { return n.name == name; });
    return static_cast<std::size_t>(std::count(labels.image.values.begin(), labels.image.values.end(), found->value));
}

TEST_F(Nrrd, LayersComeInWhicheverAxisListsThem)
{
    const Layers layers;
    const auto first = importLabels(write("a.seg.nrrd", layers.file(0)));
    EXPECT_EQ(first.image.size, Index3(4, 5, 6));
    for (const std::size_t axis : {1U, 2U, 3U}) {
        EXPECT_EQ(importLabels(write("a.seg.nrrd", layers.file(axis))).image.values, first.image.values) << axis;
    }
    const std::array<std::uint8_t, 3> colour = {255, 0, 128};
    EXPECT_EQ(first.names[0].colour, colour);
    EXPECT_EQ(first.names[2].value, 3);  // 1 is taken
}

// A voxel's layer and value are one segment, in a file of one layer too.
TEST_F(Nrrd, SegmentsThatAVoxelCannotTellApartAreRefused)
{
    const auto two = [](int value, const std::string& layer) {
        const std::string layers = layer.empty() ? "" : "Segment0_Layer:=0\nSegment1_Layer:=" + layer + "\n";
        return head("raw", fmt::format("Segment0_ID:=a\nSegment0_Name:=liver\nSegment0_LabelValue:=1\nSegment1_ID:=b\n"
                                       "Segment1_Name:=bone\nSegment1_LabelValue:={}\n{}",
                                       value, layers)) +
               bytesOf(std::vector<std::uint16_t>(120, 1));
    };
    EXPECT_EQ(reason(two(2, "0")), "");
    EXPECT_EQ(reason(two(2, "")), "") << "there is one layer only";
    EXPECT_NE(reason(two(1, "0")).find("'liver' and 'bone' both have value 1 of layer 0"), std::string::npos);
    EXPECT_NE(reason(two(1, "1")).find("'bone' is said to be in layer 1, but there is one layer"), std::string::npos);
    std::string layered = Layers().file(0);
    layered.replace(layered.find("Segment2_Layer:=1"), 17, "Segment2_Layer:=0");
    EXPECT_NE(reason(layered).find("'large' and 'small' both have value 1 of layer 0"), std::string::npos);
    layered.replace(layered.find("Segment2_Layer:=0"), 17, "Segment2_Layer:=2");
    EXPECT_NE(reason(layered).find("in layer 2, but there are 2 layers"), std::string::npos);
}

TEST_F(Nrrd, ColoursAreNoVolumes)
{
    for (const char* kind : {"RGB-color", "RGBA-color", "HSV-color", "complex"}) {
        const std::string file = fmt::format(
            "NRRD0004\ntype: uchar\ndimension: 4\nspace: LPS\nsizes: 3 4 5 6\nspace directions: none (1,0,0) (0,1,0) "
            "(0,0,1)\nkinds: {} domain domain domain\nencoding: raw\n\n{}",
            kind, std::string(360, '\1'));
        ImportOptions options;
        for (options.volume = 0; options.volume < 2; ++options.volume) {
            EXPECT_NE(reason(file, options).find("has colours or complex numbers as voxels"), std::string::npos) << kind;
        }
    }
}

// Names go to terminals and into UTF-8 files: no control character gets there, and Latin-1 is what it was meant to be.
TEST_F(Nrrd, NamesAreTextWhateverBytesTheyAre)
{
    const std::array<std::pair<std::string, std::string>, 7> names = {
        {{"Sch\xe4"
          "del",
          "Sch\xc3\xa4"
          "del"},
         {"Sch\xc3\xa4"
          "del",
          "Sch\xc3\xa4"
          "del"},
         {"\x1b[2Jred", " [2Jred"},
         {"a\x7f\xc2\x9b"
          "b\x85",
          "a  b "},
         {"\xe2\x82\xac \xf0\x9f\xab\x81", "\xe2\x82\xac \xf0\x9f\xab\x81"},
         {"\xed\xa0\x80", "\xc3\xad\xc2\xa0 "},
         {"cut \xe2\x82", "cut \xc3\xa2 "}}};
    for (const auto& [written, meant] : names) {
        const std::string segment = fmt::format("Segment0_ID:=a\nSegment0_Name:={}\nSegment0_LabelValue:=1\n", written);
        EXPECT_EQ(importLabels(write("a.seg.nrrd", head("raw", segment) + bytesOf(std::vector<std::uint16_t>(120, 1))))
                      .names.at(0)
                      .name,
                  meant);
    }
    EXPECT_EQ(reason(head("\x1b]0;x\x07")).find('\x1b'), std::string::npos);
}

// The four rules, and what each takes from whom: voxels 50..59 are large's and small's, 60..64 other's and small's.
TEST_F(Nrrd, OverlapIsResolvedByTheRuleThatIsAskedFor)
{
    const fs::path file = write("a.seg.nrrd", Layers().file(0));
    struct Case {
        std::vector<std::string> rule;
        std::size_t large, other, small;
    };
    const std::vector<Case> cases = {{{}, 50, 10, 10},  // other has 10 voxels, small 15, large 60
                                     {{"smallest"}, 50, 10, 10}, {{"last"}, 50, 5, 15},
                                     {{"first"}, 60, 10, 0},     {{"other", "small"}, 50, 5, 15},
                                     {{"large"}, 60, 10, 0}};
    for (const Case& c : cases) {
        ImportOptions options;
        options.overlap = c.rule;
        const ImportedLabels labels = importLabels(file, options);
        const std::string rule = fmt::format("{}", fmt::join(c.rule, ","));
        EXPECT_EQ(kept(labels, "large"), c.large) << rule;
        EXPECT_EQ(kept(labels, "other"), c.other) << rule;
        EXPECT_EQ(kept(labels, "small"), c.small) << rule;
        std::uint64_t lost = 0;
        for (const Overlap& o : labels.overlaps) {
            lost += o.voxels;
        }
        EXPECT_EQ(lost, 15U) << rule;  // each voxel that two claim is lost by one of them
    }
    ImportOptions options;
    options.overlap = {"heart"};
    EXPECT_NE(reason(Layers().file(0), options).find("'heart', which is no segment of it: it has large, other, small"),
              std::string::npos);
}

// A hundred random affines and spaces: what the header says is where the voxels are.
TEST_F(Nrrd, RandomGeometryComesBack)
{
    std::mt19937 random(4);
    std::uniform_real_distribution<double> uniform(-50, 50);
    const std::array<std::pair<const char*, Vec3>, 3> spaces = {
        {{"left-posterior-superior", {1, 1, 1}}, {"right-anterior-superior", {-1, -1, 1}}, {"LAS", {1, -1, 1}}}};
    for (int i = 0; i < 100; ++i) {
        const auto& [space, flip] = spaces[static_cast<std::size_t>(i) % 3];
        Vec3 a(uniform(random), uniform(random), uniform(random)), b(uniform(random), uniform(random), uniform(random));
        const Vec3 x = glm::normalize(a), y = glm::normalize(b - glm::dot(b, x) * x);
        const Vec3 z = (i % 2 == 0 ? 1.0 : -1.0) * glm::cross(x, y);
        const Vec3 origin(uniform(random), uniform(random), uniform(random));
        const auto v = [](const Vec3& p) { return fmt::format("({},{},{})", p.x, p.y, p.z); };
        const ImportedLabels labels = importLabels(
            write("a.nrrd", fmt::format("NRRD0004\ntype: uint16\nendian: little\ndimension: 3\nsizes: 4 5 6\nspace: {}\n"
                                        "space directions: {} {} {}\nspace origin: {}\nencoding: raw\n\n",
                                        space, v(0.7 * x), v(y), v(2.0 * z), v(origin)) +
                                bytesOf(ramp())));
        const Vec3 index(1.5, 2, 3);
        const Vec3 expected = 1e-3 * flip * (origin + index.x * 0.7 * x + index.y * y + index.z * 2.0 * z);
        EXPECT_NEAR(glm::length(labels.image.affine.toPatient(index) - expected), 0, 1e-12);
    }
}

}  // namespace
}  // namespace palpate::volume
