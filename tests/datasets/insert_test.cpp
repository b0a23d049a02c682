#include <base/ct_number.h>
#include <datasets/insert.h>
#include <datasets/scene_text.h>
#include <datasets/tables.h>

#include <tests/error_of.h>
#include <tests/folder.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <fstream>
#include <numbers>

namespace palpate::datasets {
namespace {

volume::Tissue block()
{
    PhantomSpec spec;
    spec.name = "block";
    spec.numbers = {{"tumours", 0}, {"width_mm", 40}, {"thickness_mm", 40}};
    return makePhantom(spec, defaultTissues());
}

double volumeOf(const volume::Tissue& tissue, const std::string& name)
{
    double sum = 0;
    for (const auto& s : tissue.structures()) {
        sum += s.name == name ? s.volume : 0.0;
    }
    return sum;
}

Insert ball(Vec3 centre, double diameter)
{
    Insert insert;
    insert.centre = centre;
    insert.diameter = diameter;
    return insert;
}

// pi d^3 / 6, and for a rod with round ends pi d^2 l / 4 more.
TEST(Insert, HasTheVolumeOfItsShape)
{
    constexpr double d = 14e-3, length = 12e-3, pi = std::numbers::pi;
    const Insert one = ball({0, 20e-3, 0}, d);
    EXPECT_NEAR(volumeOf(withInserts(block(), {&one, 1}), "lesion"), pi * d * d * d / 6, 0.03 * pi * d * d * d / 6);
    Insert rod = ball({-length / 2, 20e-3, 0}, d);
    rod.to = Vec3(length / 2, 20e-3, 0);
    const double volume = pi * d * d * d / 6 + pi * d * d / 4 * length;
    EXPECT_NEAR(volumeOf(withInserts(block(), {&rod, 1}), "lesion"), volume, 0.03 * volume);
    Insert spiky = one;
    spiky.spiculated = true;
    EXPECT_NEAR(volumeOf(withInserts(block(), {&spiky, 1}), "lesion"), pi * d * d * d / 6, 0.1 * pi * d * d * d / 6);
}

// With an image that scales the stiffness: what is put in is as stiff as the table says and looks in CT as its tissue does;
// a new table, and a file, change nothing of that.
TEST(Insert, IsAsStiffAsTheTableSaysAndSeenInCt)
{
    const volume::Tissue plain = block();
    volume::CompanionImage image;
    image.unit = "HU";
    image.values.assign(plain.labels().values.size(), -110);
    image.stiffness.points = {{-110, 0.5}, {140, 2}};
    std::vector<volume::LabelName> names;
    for (const auto& s : plain.structures()) {
        names.push_back({s.value, s.name, plain.table().rows[s.tissue].name});
    }
    const auto scaled = volume::Tissue::fromLabels(plain.labels(), plain.table(), names, {}, &image);
    Insert one = ball({0, 20e-3, 0}, 14e-3);
    one.tissue = "bone";
    const tests::Folder folder;
    const volume::Tissue with = withInserts(scaled, {&one, 1});
    with.save(folder / "with.vdb");
    const auto check = [&](const volume::Tissue& t) {
        const volume::Tissue::Reader reader(t);
        const auto bone = t.table().rows[*t.table().find("bone")], fat = t.table().rows[reader.tissue({0, 5e-3, 0})];
        EXPECT_NEAR(reader.youngsModulus(one.centre) / bone.youngsModulus, 1, 1e-6);
        EXPECT_NEAR(reader.youngsModulus({0, 5e-3, 0}) / fat.youngsModulus, 0.5, 1e-6);
        const auto companion = t.companion();
        const Index3 at(glm::round(t.affine().toIndex(one.centre)));
        EXPECT_FLOAT_EQ(companion->values[t.labels().offset(at)], base::ctNumberOf(bone.density));
    };
    check(with);
    check(withTable(with, with.table()));
    check(volume::Tissue::load(folder / "with.vdb"));
}

// A volume may have labels up to the largest there is: inserts take free ones, and where there is none they are refused.
TEST(Insert, TakesALabelThatIsFree)
{
    volume::LabelImage image;
    image.size = {40, 40, 40};
    image.affine = {Mat3(1e-3), Vec3(-20e-3, 0, -20e-3)};
    image.values.assign(64000, 65534);
    image.values[image.offset({20, 20, 20})] = 65535;
    const std::vector<volume::LabelName> names{{65534, "fat", "fat"}, {65535, "aim", "gland"}};
    const volume::Tissue all = volume::Tissue::fromLabels(image, defaultTissues(), names, {});
    std::vector<Insert> two{ball({-8e-3, 20e-3, 0}, 8e-3), ball({8e-3, 20e-3, 0}, 8e-3)};
    two[1].name = "second";
    const volume::Tissue made = withInserts(all, two);
    EXPECT_DOUBLE_EQ(volumeOf(made, "aim"), 1e-9);
    EXPECT_NEAR(volumeOf(made, "lesion"), volumeOf(made, "second"), 1e-9);
    EXPECT_GT(volumeOf(made, "second"), 200e-9);
    double sum = 0;
    for (const auto& s : made.structures()) {
        sum += s.volume;
    }
    EXPECT_NEAR(sum, 64e-6, 1e-12);
}

TEST(Insert, ChangesOnlyTissueUnderIt)
{
    const volume::Tissue before = block();
    const Insert insert = ball({0, 1e-3, 0}, 8e-3);  // reaches out of the skin
    const volume::Tissue after = withInserts(before, {&insert, 1});
    const volume::Tissue::Reader a(before), b(after);
    volume::forEachIndex(Index3(0), before.size() - 1, [&](Index3 n) {
        const Vec3 p = before.affine().toPatient(Vec3(n));
        const bool under = glm::distance(p, insert.centre) <= insert.diameter / 2 && a.tissue(p) != 0;
        if (under) {
            EXPECT_EQ(after.table().rows[b.tissue(p)].name, "idc_high_grade");
        } else {
            EXPECT_EQ(b.tissue(p), a.tissue(p));
        }
    });
}

TEST(Insert, RefusesWhatCannotBe)
{
    const volume::Tissue tissue = block();
    Insert insert = ball({0, 20e-3, 0}, 8e-3);
    insert.tissue = "cheese";
    EXPECT_NE(tests::errorOf([&] { withInserts(tissue, {&insert, 1}); }).find("cheese"), std::string::npos);
    insert = ball({0, -80e-3, 0}, 8e-3);
    EXPECT_NE(tests::errorOf([&] { withInserts(tissue, {&insert, 1}); }).find("no tissue"), std::string::npos);
    const Insert small = ball({0.5e-3, 20.5e-3, 0.5e-3}, 0.2e-3);  // between the middles of voxels or about one
    const Insert beside = ball({0.25e-3, 20.25e-3, 0.25e-3}, 0.2e-3);
    const std::string fault = tests::errorOf([&] {
                                  withInserts(tissue, {&small, 1});
                              }) +
                              tests::errorOf([&] {
                                  withInserts(tissue, {&beside, 1});
                              });
    EXPECT_NE(fault.find("with 0.2 mm it holds the middle of no voxel: make it larger"), std::string::npos) << fault;
    EXPECT_EQ(fault.find("no tissue"), std::string::npos) << fault;
    insert = ball({0, 20e-3, 0}, 8e-3);
    insert.name = "fat";
    EXPECT_NE(tests::errorOf([&] { withInserts(tissue, {&insert, 1}); }).find("another name"), std::string::npos);
}

TEST(Insert, SurvivesTheText)
{
    const Scene scene = *builtInScene("behind-rib");
    const Scene again = parseScene(sceneText(scene), "again.toml");
    ASSERT_EQ(again.source.inserts.size(), scene.source.inserts.size());
    for (std::size_t i = 0; i < scene.source.inserts.size(); ++i) {
        EXPECT_EQ(again.source.inserts[i].name, scene.source.inserts[i].name);
        EXPECT_LT(glm::distance(again.source.inserts[i].centre, scene.source.inserts[i].centre), 1e-12);
        EXPECT_EQ(again.source.inserts[i].to.has_value(), scene.source.inserts[i].to.has_value());
    }
}

std::filesystem::path written(const std::filesystem::path& file, const std::string& text)
{
    std::ofstream(file) << text;
    return file;
}

TEST(Locations, AreReadInMillimetres)
{
    const tests::Folder folder;
    const auto places = loadLocations(written(folder.path() / "a.loc", "4.5E+00,-3.25,1e1\n\n-1,2,3\r\n"));
    ASSERT_EQ(places.size(), 2U);
    EXPECT_LT(glm::distance(places[0], Vec3(4.5e-3, -3.25e-3, 10e-3)), 1e-15);
    EXPECT_LT(glm::distance(places[1], Vec3(-1e-3, 2e-3, 3e-3)), 1e-15);
}

TEST(Locations, ErrorsNameTheLine)
{
    const tests::Folder folder;
    for (const char* bad : {"1,2", "1,2,x", "1;2;3", "1,2,3,4", "1,2,nan", "1,2,9e9"}) {
        const auto file = written(folder.path() / "bad.loc", std::string("1,2,3\n") + bad + "\n");
        const std::string error = tests::errorOf([&] { loadLocations(file); });
        EXPECT_NE(error.find("bad.loc:2:"), std::string::npos) << bad << " gave '" << error << "'";
    }
    EXPECT_NE(tests::errorOf([&] { loadLocations(written(folder.path() / "empty.loc", "\n")); }), "");
    EXPECT_NE(tests::errorOf([&] { loadLocations(folder.path() / "none.loc"); }), "");
}

// Of four places only one has room: every seed comes to it, and no place is no place.
TEST(Locations, ALesionIsPutWhereThereIsRoom)
{
    const tests::Folder folder;
    const volume::Tissue tissue = block();
    const auto file = written(folder.path() / "p.loc", "0,1,0\n0,20,0\n0,-30,0\n19,20,0\n");
    for (std::uint64_t seed = 0; seed < 8; ++seed) {
        Insert lesion = ball(Vec3(0.0), 10e-3);
        lesion.seed = seed;
        EXPECT_LT(glm::distance(placeLesion(tissue, file, lesion).centre, Vec3(0, 20e-3, 0)), 1e-12);
    }
    const auto outside = written(folder.path() / "q.loc", "0,-30,0\n");
    EXPECT_NE(tests::errorOf([&] { placeLesion(tissue, outside, ball(Vec3(0.0), 10e-3)); }).find("none of its 1"),
              std::string::npos);
}

}  // namespace
}  // namespace palpate::datasets
