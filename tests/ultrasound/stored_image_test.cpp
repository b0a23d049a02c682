#include <ultrasound/stored_image.h>

#include <base/outputs.h>
#include <tests/error_of.h>
#include <tests/folder.h>

#include <gtest/gtest.h>

#include <fstream>

namespace palpate::ultrasound {
namespace {

BeamImage example()
{
    BeamImage image;
    image.tick = 8123;
    image.shapeTick = 8118;
    image.transducer = curvedProbe();
    image.settings = settingsOf(image.transducer);
    image.settings.tgc = {1, -2, 3.25F, 0, 0, 0, 0, 0.1F};
    image.settings.gain = -3.3F;
    image.pose = poseOf({0.1, 1.0 / 3, -0.2}, {0.1, 0.9, 0.2}, {1, 0, 0.3});
    image.body = 0xfedcba9876543210;
    image.mirrored = true;
    image.grey.resize(static_cast<std::size_t>(image.settings.lines) * static_cast<std::size_t>(image.settings.samples));
    for (std::size_t i = 0; i < image.grey.size(); ++i)
        image.grey[i] = static_cast<std::uint8_t>(i * 7919 >> 8U);
    return image;
}

// All digits come back, so that the picture can be made again bit for bit.
TEST(StoredImage, SaysHowItWasMade)
{
    const tests::Folder folder;
    const BeamImage image = example();
    const auto file = folder.path() / "us.png";
    base::writeWhole(file, storedImage(image, 640, 480));
    const StoredHow how = readStored(file);
    EXPECT_EQ(how.width, 640);
    EXPECT_EQ(how.height, 480);
    EXPECT_EQ(how.image.tick, image.tick);
    EXPECT_EQ(how.image.shapeTick, image.shapeTick);
    EXPECT_EQ(how.image.body, image.body);
    EXPECT_EQ(how.image.settings, image.settings);
    EXPECT_EQ(how.image.pose.face, image.pose.face);
    EXPECT_EQ(how.image.pose.axial, image.pose.axial);
    EXPECT_EQ(how.image.pose.lateral, image.pose.lateral);
    EXPECT_EQ(how.image.pose.elevation, image.pose.elevation);
    EXPECT_EQ(how.image.mirrored, image.mirrored);
    EXPECT_EQ(how.image.transducer.shape, ProbeShape::curved);
    EXPECT_EQ(storedImage(image, 640, 480), storedImage(image, 640, 480));
}

// As those of before.
TEST(StoredImage, NeedNotSayOfWhichBodyItIs)
{
    const tests::Folder folder;
    BeamImage image = example();
    image.body = 0;
    const auto file = folder.path() / "us.png";
    base::writeWhole(file, storedImage(image, 64, 48));
    EXPECT_EQ(readStored(file).image.body, 0U);
}

TEST(StoredImage, RefusesWhatIsNoneOfOurs)
{
    const tests::Folder folder;
    const auto file = folder.path() / "us.png";
    const std::string whole = storedImage(example(), 64, 48);
    const auto none = folder.path() / "none.png";
    EXPECT_EQ(tests::errorOf([&] { readStored(none); }), none.string() + ": there is no such file: check the name");
    EXPECT_EQ(tests::errorOf([&] { readStored(folder.path()); }),
              folder.path().string() + ": is a folder, not a file: name a file in it");
    for (const std::string& bytes : {std::string("hello"), std::string(), whole.substr(0, 20), whole.substr(0, 60)}) {
        base::writeWhole(file, bytes);
        EXPECT_NE(tests::errorOf([&] { readStored(file); }).find("no ultrasound image"), std::string::npos);
    }
    std::string damaged = whole;
    damaged[damaged.find("\"tick\"") + 1] = 'T';
    base::writeWhole(file, damaged);
    EXPECT_NE(tests::errorOf([&] { readStored(file); }).find("is damaged"), std::string::npos);
}

}  // namespace
}  // namespace palpate::ultrasound
