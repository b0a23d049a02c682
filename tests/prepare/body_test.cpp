#include <datasets/tables.h>
#include <volume/import.h>
#include <volume/prepare/body.h>
#include <volume/prepare/mapping.h>
#include <volume/resample.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <random>
#include <set>

namespace palpate::prepare {
namespace {

using volume::LabelImage;
using volume::LabelName;

void silent(const std::string& /*what*/) {}

LabelImage empty(Index3 size, double spacing)
{
    LabelImage image{size, {Mat3(spacing), Vec3(0.0)}, {}};
    image.values.assign(image.offset({0, 0, size.z}), 0);
    return image;
}

std::map<std::uint16_t, std::string> namesByValue(const std::vector<LabelName>& names)
{
    std::map<std::uint16_t, std::string> out;
    for (const LabelName& n : names) {
        out[n.value] = n.name;
    }
    return out;
}

// A trunk of CT numbers: an elliptic cylinder of fat under skin, a muscle wall in it, a vertebra with a shell and darker
// marrow, a bright even vessel, a lung with noise of its own, a liver with a label; a table below and a cable above.
class Trunk : public ::testing::Test {
protected:
    static constexpr double spacing = 2e-3;
    LabelImage labels = empty({90, 70, 30}, spacing);
    std::vector<LabelName> names{{7, "liver", "liver"}};
    std::vector<float> hu;
    std::vector<std::string> truth;

    static double away(Vec3 p, double x, double y) { return std::hypot(p.x - x, p.y - y); }

    static std::pair<std::string, float> at(Vec3 p, double noise)
    {
        const double r = std::hypot((p.x - 0.09) / 0.08, (p.y - 0.065) / 0.055);
        const auto n = static_cast<float>(noise);
        if (away(p, 0.09, 0.098) < 0.012) {
            return {"body_bone", away(p, 0.09, 0.098) > 0.009 ? 500 + n : 180 + n};
        }
        if (away(p, 0.09, 0.066) < 0.008) {
            return {"body_vessel", 260 + 0.5F * n};
        }
        if (away(p, 0.055, 0.05) < 0.016) {
            return {"body_lung", -800 + n};
        }
        if (away(p, 0.125, 0.05) < 0.014) {
            return {"liver", 60 + n};
        }
        if (r < 1) {
            return r < 0.65  ? std::pair("body_fat", -95 + n)
                   : r < 0.8 ? std::pair("body_muscle", 55 + n)
                             : std::pair("body_fat", -100 + n);
        }
        const bool table = p.y > 0.128 && p.y < 0.132, cable = away(p, 0.02, 0.012) < 3e-3;
        return {"outside", table ? 300 : cable ? 900 : -1000 + n};
    }

    void SetUp() override
    {
        volume::forEachIndex(Index3(0), labels.size - 1, [&](Index3 n) {
            const double noise = 10 * std::sin(12.9898 * n.x + 78.233 * n.y + 37.719 * n.z);
            const auto [name, value] = at(spacing * Vec3(n), noise);
            truth.push_back(name);
            hu.push_back(value);
            labels.values[labels.offset(n)] = name == "liver" ? 7 : 0;
        });
    }

    double dice(const std::string& name, const std::map<std::uint16_t, std::string>& named) const
    {
        double both = 0, sum = 0;
        for (std::size_t i = 0; i < truth.size(); ++i) {
            const bool ours = labels.values[i] != 0 && named.at(labels.values[i]) == name, theirs = truth[i] == name;
            both += ours && theirs ? 1 : 0;
            sum += (ours ? 1 : 0) + (theirs ? 1 : 0);
        }
        return 2 * both / sum;
    }
};

TEST_F(Trunk, IsFoundTissueByTissue)
{
    const LabelImage before = labels;
    bodyFromImage(labels, names, hu, datasets::defaultTissues(), silent);
    const auto named = namesByValue(names);
    for (const std::string name : {"body_fat", "body_muscle", "body_bone", "body_vessel", "body_lung", "liver"}) {
        EXPECT_GT(dice(name, named), name == "body_fat" ? 0.9 : name == "liver" ? 0.9999 : 0.93) << name;
    }
    for (std::size_t i = 0; i < truth.size(); ++i) {
        const bool outside = truth[i] == "outside";
        EXPECT_TRUE(!outside || labels.values[i] == 0) << "table, cable and air are no body";
        EXPECT_TRUE(outside || labels.values[i] != 0) << truth[i];
        EXPECT_TRUE(before.values[i] == 0 || labels.values[i] == before.values[i]) << "a label wins";
    }
}

// Whatever has a face to the outside is skin, and no skin is deeper than 6 mm.
TEST_F(Trunk, IsCoveredBySkin)
{
    bodyFromImage(labels, names, hu, datasets::defaultTissues(), silent);
    const auto named = namesByValue(names);
    std::size_t surface = 0;
    volume::forEachIndex(Index3(1, 1, 0), labels.size - Index3(2, 2, 1), [&](Index3 n) {
        const auto value = [&](Index3 at) { return labels.values[labels.offset(at)]; };
        const bool face = value(n + Index3(1, 0, 0)) == 0 || value(n - Index3(1, 0, 0)) == 0 ||
                          value(n + Index3(0, 1, 0)) == 0 || value(n - Index3(0, 1, 0)) == 0;
        if (value(n) != 0 && face) {
            ++surface;
            EXPECT_EQ(named.at(value(n)), "body_skin");
        }
        if (value(n) != 0 && named.at(value(n)) == "body_skin") {
            const Vec3 p = spacing * Vec3(n);
            EXPECT_GT(std::hypot((p.x - 0.09) / 0.08, (p.y - 0.065) / 0.055), 1 - 6e-3 / 0.055);
        }
    });
    EXPECT_GT(surface, 1000U);
}

// The report's voxels are those that changed, and the volumes add up to what has no label.
TEST_F(Trunk, StepsCountEveryVoxel)
{
    const auto steps = bodyFromImage(labels, names, hu, datasets::defaultTissues(), silent);
    const auto named = namesByValue(names);
    for (const PreparationStep& step : steps) {
        if (!step.structure.empty()) {
            const auto counted = std::count_if(labels.values.begin(), labels.values.end(),
                                               [&](std::uint16_t v) { return v != 0 && named.at(v) == step.structure; });
            EXPECT_EQ(static_cast<std::uint64_t>(counted), step.voxels) << step.structure;
            EXPECT_NEAR(step.volume, static_cast<double>(counted) * 8e-9, 1e-12);
        }
    }
}

TEST_F(Trunk, ImagesWithoutABodyAreRefused)
{
    labels.values.assign(labels.values.size(), 0);
    hu.assign(hu.size(), -1000);
    EXPECT_THROW(bodyFromImage(labels, names, hu, datasets::defaultTissues(), silent), std::runtime_error);
}

// A ball of radius r gets a hull of radius r + t whose outermost layer is skin, also where the volume ended before.
TEST(Hull, OfABallIsABall)
{
    constexpr double spacing = 1e-3, radius = 8e-3, thickness = 10e-3;
    LabelImage image = empty(Index3(20), spacing);
    volume::forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        image.values[image.offset(n)] = glm::length(spacing * (Vec3(n) - 9.5)) <= radius ? 3 : 0;
    });
    const Vec3 middle = image.affine.toPatient(Vec3(9.5));
    const auto organ = std::count(image.values.begin(), image.values.end(), 3);
    std::vector<LabelName> names{{3, "prostate", "prostate"}};
    bodyFromHull(image, names, thickness, datasets::defaultTissues(), silent);
    const auto named = namesByValue(names);
    EXPECT_EQ(std::count(image.values.begin(), image.values.end(), 3), organ);
    volume::forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        const double r = glm::length(image.affine.toPatient(Vec3(n)) - middle);
        const std::uint16_t value = image.values[image.offset(n)];
        if (r > radius + thickness + spacing) {
            EXPECT_EQ(value, 0);
        } else if (r < radius + thickness - spacing) {
            ASSERT_NE(value, 0);
        }
        if (value != 0 && value != 3) {
            EXPECT_EQ(named.at(value).rfind("invented_", 0), 0U);
            EXPECT_TRUE(r > radius + thickness - 4 * spacing || named.at(value) == "invented_soft_tissue");
        }
    });
}

// --- Against TotalSegmentator's own masks -------------------------------------------------------------------------

const std::string data = PALPATE_TEST_DATA;

struct Patient {
    LabelImage labels;
    std::vector<LabelName> names;
    std::vector<float> hu;
    std::vector<std::string> tissue;  // of every voxel, by the labels
};

std::vector<std::string> tissuesOf(const LabelImage& image, const std::vector<LabelName>& names)
{
    std::map<std::uint16_t, std::string> of{{0, "air"}};
    for (const LabelName& n : names) {
        of[n.value] = n.tissue;
    }
    std::vector<std::string> out(image.values.size());
    std::transform(image.values.begin(), image.values.end(), out.begin(), [&](std::uint16_t v) { return of.at(v); });
    return out;
}

Patient patient(const std::string& labels, const std::string& ct)
{
    volume::ImportedLabels read = volume::importLabels(data + labels);
    const volume::ImportedImage image = volume::importImage(data + ct);
    std::vector<std::string> notes;
    Patient p{{}, {}, {}, {}};
    MappingOptions map;
    map.map = "totalsegmentator";
    p.names = mapLabels(map, data + labels, read, countLabels(read.image), datasets::defaultTissues(), notes);
    p.hu = volume::resampledImage({image.size, image.affine}, image.values, {read.image.size, read.image.affine},
                                  std::nanf(""));
    p.labels = std::move(read.image);
    p.tissue = tissuesOf(p.labels, p.names);
    return p;
}

// Takes the labels of some tissues away, and has the image give them back.
std::vector<std::string> recovered(Patient p, const std::set<std::string>& heldBack)
{
    for (std::size_t i = 0; i < p.tissue.size(); ++i) {
        p.labels.values[i] = heldBack.count(p.tissue[i]) > 0 ? 0 : p.labels.values[i];
    }
    bodyFromImage(p.labels, p.names, p.hu, datasets::defaultTissues(), silent);
    return tissuesOf(p.labels, p.names);
}

template <typename Truth, typename Ours>
double diceOf(const char* what, std::size_t count, const Truth& truth, const Ours& ours)
{
    double a = 0, b = 0, both = 0;
    for (std::size_t i = 0; i < count; ++i) {
        a += truth(i) ? 1 : 0;
        b += ours(i) ? 1 : 0;
        both += truth(i) && ours(i) ? 1 : 0;
    }
    const double dice = 2 * both / (a + b);
    fmt::print("  Dice {:<52} {:.3f}  ({:.0f} voxels of theirs, {:.0f} of ours)\n", what, dice, a, b);
    return dice;
}

std::vector<std::uint16_t> mask(const char* name)
{
    return volume::importLabels(data + "/totalsegmentator_ct/example_seg_tissue_types/" + name).image.values;
}

// The voxels that share a face with the set, and the set.
std::vector<char> grown(const LabelImage& places, const std::vector<char>& set)
{
    std::vector<char> out = set;
    volume::forEachIndex(Index3(0), places.size - 1, [&](Index3 n) {
        for (int side = 0; side < 6; ++side) {
            Index3 next = n;
            next[side / 2] += side % 2 == 0 ? 1 : -1;
            if (glm::all(glm::greaterThanEqual(next, Index3(0))) && glm::all(glm::lessThan(next, places.size)) &&
                set[places.offset(n)] != 0) {
                out[places.offset(next)] = 1;
            }
        }
    });
    return out;
}

bool hasData()
{
    return std::filesystem::exists(data + "/totalsegmentator_ct/example_seg.nii.gz");
}

// TotalSegmentator's task tissue_types against ours, with the organs' labels in place.
TEST(BodyOfAPatient, FatAndMuscleAreThoseOfTotalSegmentator)
{
    if (!hasData()) {
        GTEST_SKIP() << "no test volumes in " << data;
    }
    const Patient p = patient("/totalsegmentator_ct/example_seg.nii.gz", "/totalsegmentator_ct/example_ct_sm.nii.gz");
    const auto ours = recovered(p, {});
    const auto subcutaneous = mask("subcutaneous_fat.nii.gz"), inner = mask("torso_fat.nii.gz"),
               muscle = mask("skeletal_muscle.nii.gz");
    EXPECT_GE(
        diceOf(
            "fat, subcutaneous and of the torso", ours.size(),
            [&](std::size_t i) { return subcutaneous[i] + inner[i] > 0; }, [&](std::size_t i) { return ours[i] == "fat"; }),
        0.90);
    EXPECT_GE(diceOf(
                  "skeletal muscle", ours.size(), [&](std::size_t i) { return muscle[i] > 0; },
                  [&](std::size_t i) { return ours[i] == "muscle"; }),
              0.80);
}

// There is no mask of the skin. TotalSegmentator makes it from the body by a rule (extract_skin in its postprocessing.py):
// a layer at the body's surface, between -200 and 250 HU. Here the body is what its masks and labels have; they end
// below the skin, which is the layer around them.
TEST(BodyOfAPatient, SkinIsTheLayerAroundTotalSegmentatorsMasks)
{
    if (!hasData()) {
        GTEST_SKIP() << "no test volumes in " << data;
    }
    const Patient p = patient("/totalsegmentator_ct/example_seg.nii.gz", "/totalsegmentator_ct/example_ct_sm.nii.gz");
    const auto ours = recovered(p, {});
    const auto subcutaneous = mask("subcutaneous_fat.nii.gz"), muscle = mask("skeletal_muscle.nii.gz");
    std::vector<char> body(ours.size());
    for (std::size_t i = 0; i < body.size(); ++i) {
        body[i] = subcutaneous[i] + muscle[i] > 0 || (p.tissue[i] != "air") ? 1 : 0;
    }
    // Around the fat, but not inside the body: no layer around a hole in the masks.
    const std::vector<char> layer = grown(p.labels, grown(p.labels, body));
    std::vector<char> outside(body.size(), 0);
    outside[0] = 1;
    for (std::size_t before = 0, now = 1; before != now;
         before = now, now = static_cast<std::size_t>(std::count(outside.begin(), outside.end(), 1))) {
        const std::vector<char> next = grown(p.labels, outside);
        for (std::size_t i = 0; i < next.size(); ++i) {
            outside[i] = next[i] != 0 && layer[i] == 0 ? 1 : outside[i];
        }
    }
    const std::vector<char> fromOutside = grown(p.labels, grown(p.labels, outside));
    EXPECT_GE(diceOf(
                  "skin, by TotalSegmentator's rule", ours.size(),
                  [&](std::size_t i) {
                      return layer[i] != 0 && body[i] == 0 && fromOutside[i] != 0 && p.hu[i] > -200 && p.hu[i] < 250;
                  },
                  [&](std::size_t i) { return ours[i] == "skin"; }),
              0.6);
}

const std::set<std::string> bones{"bone", "rib"};

// Dice of the bones that come back with the labels of some tissues held back.
double boneDice(const Patient& p, const char* what, const std::set<std::string>& heldBack)
{
    const auto ours = recovered(p, heldBack);
    return diceOf(
        what, ours.size(), [&](std::size_t i) { return bones.count(p.tissue[i]) > 0; },
        [&](std::size_t i) { return bones.count(ours[i]) > 0; });
}

std::set<std::string> allTissues(const Patient& p)
{
    std::set<std::string> all(p.tissue.begin(), p.tissue.end());
    all.erase("air");
    return all;
}

class BonesOfAPatient : public ::testing::Test {
protected:
    Patient torso, abdomen;

    void SetUp() override
    {
        if (!hasData()) {
            GTEST_SKIP() << "no test volumes in " << data;
        }
        torso =
            patient("/totalsegmentator_ct/example_seg_fast_force_split.nii.gz", "/totalsegmentator_ct/example_ct.nii.gz");
        abdomen = patient("/totalsegmentator_ct/example_seg.nii.gz", "/totalsegmentator_ct/example_ct_sm.nii.gz");
    }
};

// Bones whose labels are held back come back from the image. TotalSegmentator's two models agree to 0.958 on the bones
// of the upper abdomen.
TEST_F(BonesOfAPatient, WithoutLabelsAreFound)
{
    EXPECT_GE(boneDice(torso, "bone, torso, bones held back", bones), 0.90);
    EXPECT_GE(boneDice(abdomen, "bone, upper abdomen, bones held back", bones), 0.90);
    EXPECT_GE(boneDice(torso, "bone, torso, every label held back", allTissues(torso)), 0.90);
    EXPECT_GE(boneDice(abdomen, "bone, upper abdomen, every label held back", allTissues(abdomen)), 0.88);
}

// Noise of a low dose, and contrast medium in vessels and organs that have no label.
TEST_F(BonesOfAPatient, AreFoundInOtherImagesOfThem)
{
    for (Patient p : {torso, abdomen}) {
        std::mt19937 random(1);
        std::normal_distribution<float> noise(0, 30);
        for (float& v : p.hu) {
            v += noise(random);
        }
        EXPECT_GE(boneDice(p, "bone, with noise of 30 HU", bones), 0.88);
    }
    const std::map<std::string, float> bolus{
        {"aorta", 200.0F},        {"iliac_artery_left", 200.0F}, {"iliac_artery_right", 200.0F},
        {"kidney_right", 140.0F}, {"kidney_left", 140.0F},       {"spleen", 80.0F},
        {"liver", 60.0F},         {"inferior_vena_cava", 110.0F}};
    for (Patient p : {torso, abdomen}) {
        const auto named = namesByValue(p.names);
        for (std::size_t i = 0; i < p.hu.size(); ++i) {
            const auto more = p.labels.values[i] != 0 ? bolus.find(named.at(p.labels.values[i])) : bolus.end();
            p.hu[i] += more != bolus.end() ? more->second : 0.0F;
        }
        EXPECT_GE(boneDice(p, "bone, contrast medium, every label held back", allTissues(p)), 0.86);
    }
}

}  // namespace
}  // namespace palpate::prepare
