// Readers that break down take nobody with them.
#include <tests/error_of.h>
#include <volume/import/barrier.h>

#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdlib>
#include <new>
#include <stdexcept>

namespace palpate::volume {
namespace {

ImportedLabels labelsOf(const LabelReader& read, const ImportOptions& options = {})
{
    return labelsApart("a.dcm", "the library", options, read);
}

std::string reason(const LabelReader& read)
{
    return tests::errorOf([&] { labelsOf(read); });
}

// Everything that is read comes over whole, more of it than a pipe holds at once.
TEST(Barrier, LabelsComeOverAsTheyAre)
{
    ImportedLabels labels;
    labels.image.size = {300, 200, 50};
    labels.image.affine = {Mat3(1, 2, 3, 4, 5, 6, 7, 8, 10), Vec3(0.1, -2, 1e-9)};
    for (std::size_t i = 0; i < 300 * 200 * 50; ++i) {
        labels.image.values.push_back(static_cast<std::uint16_t>(i % 60013));
    }
    labels.names = {{3, "tumour", "idc", std::array<std::uint8_t, 3>{1, 2, 255}, "SCT^108369006^Neoplasm"},
                    {4, "", "", {}, ""}};
    labels.overlaps = {{3, 4, 70000000000}};
    labels.warnings = {"one", "", "three"};
    labels.frame = "1.2.3";
    labels.madeOf = {"4.5", "6.7"};
    const pid_t here = ::getpid();
    const ImportedLabels over = labelsOf([&](const ImportOptions&) {
        EXPECT_NE(::getpid(), here);
        return labels;
    });
    EXPECT_EQ(over.image.size, labels.image.size);
    EXPECT_EQ(over.image.affine.linear, labels.image.affine.linear);
    EXPECT_EQ(over.image.affine.origin, labels.image.affine.origin);
    EXPECT_EQ(over.image.values, labels.image.values);
    EXPECT_EQ(over.frame, labels.frame);
    EXPECT_EQ(over.madeOf, labels.madeOf);
    ASSERT_EQ(over.names.size(), 2U);
    for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_EQ(over.names[i].value, labels.names[i].value);
        EXPECT_EQ(over.names[i].name, labels.names[i].name);
        EXPECT_EQ(over.names[i].tissue, labels.names[i].tissue);
        EXPECT_EQ(over.names[i].colour, labels.names[i].colour);
        EXPECT_EQ(over.names[i].terminology, labels.names[i].terminology);
    }
    ASSERT_EQ(over.overlaps.size(), 1U);
    EXPECT_EQ(over.overlaps[0].kept, 3);
    EXPECT_EQ(over.overlaps[0].lost, 4);
    EXPECT_EQ(over.overlaps[0].voxels, 70000000000U);
    EXPECT_EQ(over.warnings, labels.warnings);
}

TEST(Barrier, ImagesComeOverAsTheyAre)
{
    ImportedImage image;
    image.size = {2, 1, 2};
    image.affine = {Mat3(2.0), Vec3(1, 2, 3)};
    image.values = {-1000.0F, 0.25F, 3e38F, -0.0F};
    image.what = "HU";
    image.warnings = {"is one slice only"};
    const ImportedImage over = imageApart("a.dcm", "the library", {}, [&](const ImportOptions&) { return image; });
    EXPECT_EQ(over.size, image.size);
    EXPECT_EQ(over.affine.linear, image.affine.linear);
    EXPECT_EQ(over.affine.origin, image.affine.origin);
    EXPECT_EQ(over.values, image.values);
    EXPECT_EQ(over.what, "HU");
    EXPECT_EQ(over.warnings, image.warnings);
}

TEST(Barrier, ARefusalIsThrownOnAsItIs)
{
    EXPECT_EQ(reason([](const ImportOptions&) -> ImportedLabels { throw std::runtime_error("a.dcm: no"); }), "a.dcm: no");
    EXPECT_THROW(labelsOf([](const ImportOptions&) -> ImportedLabels { throw std::logic_error("ours"); }),
                 std::logic_error);
    EXPECT_NE(reason([](const ImportOptions&) -> ImportedLabels { throw std::bad_alloc(); }).find("memory"),
              std::string::npos);
}

// A failed assertion, a wild pointer, the system's killer: the file is refused on one line that names it.
TEST(Barrier, AReaderThatDiesRefusesTheFile)
{
    for (const int signal : {SIGABRT, SIGSEGV, SIGKILL}) {
        const std::string why = reason([signal](const ImportOptions&) -> ImportedLabels {
            std::signal(signal, SIG_DFL);  // no sanitizer's
            ::raise(signal);
            return {};
        });
        EXPECT_EQ(why.rfind("a.dcm: ", 0), 0U) << why;
        EXPECT_EQ(why.find('\n'), std::string::npos) << why;
    }
    // A library has no business to end the program; where a sanitizer does, it is no refusal.
    EXPECT_THROW(labelsOf([](const ImportOptions&) -> ImportedLabels { ::_exit(1); }), std::logic_error);
}

TEST(Barrier, ProgressIsToldHere)
{
    std::vector<double> told;
    ImportOptions options;
    options.progress = [&](double fraction) { told.push_back(fraction); };
    labelsOf(
        [](const ImportOptions& o) {
            o.progress(0.25);
            o.progress(1);
            return ImportedLabels{};
        },
        options);
    EXPECT_EQ(told, (std::vector<double>{0.25, 1}));
}

// A reader whose result nobody waits for any more is ended, not left behind.
TEST(Barrier, AnExceptionInProgressEndsTheReader)
{
    ImportOptions options;
    options.progress = [](double) { throw std::runtime_error("enough"); };
    const auto forever = [](const ImportOptions& o) -> ImportedLabels {
        o.progress(0);
        for (;;) {
            ::pause();
        }
    };
    EXPECT_THROW(labelsOf(forever, options), std::runtime_error);
}

}  // namespace
}  // namespace palpate::volume
