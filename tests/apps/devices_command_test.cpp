#include <tests/apps/program.h>

#include <gtest/gtest.h>

namespace palpate::apps {
namespace {

TEST(DevicesCommand, WritesTheRuleAndThenFindsIt)
{
    const Folder folder;
    const std::string rules = folder.path().string();
    EXPECT_FALSE(figures({"devices", "--udev-folder", rules}).at("udev_rule").at("installed").get<bool>());
    ASSERT_EQ(palpate({"devices", "--install-udev", "--udev-folder", rules}).status, 0);
    const std::string rule = readText(folder / "70-palpate-falcon.rules");
    EXPECT_NE(rule.find("ATTR{idVendor}==\"0403\", ATTR{idProduct}==\"cb48\""), std::string::npos) << rule;
    EXPECT_TRUE(figures({"devices", "--udev-folder", rules}).at("udev_rule").at("installed").get<bool>());
}

TEST(DevicesCommand, RefusesWhatIsNoFirmware)
{
    const Folder folder;
    writeText(folder / "short.bin", "x");
    const std::string file = (folder / "short.bin").string();
    expectRefusal({"devices", "--falcon-firmware", file}, "has 1 bytes, a Falcon's firmware has 512 to 1048576");
    expectRefusal({"train", "block", "--no-view", "--device", "falcon", "--falcon-firmware", file},
                  "short.bin: has 1 bytes");
    expectRefusal({"devices", "--falcon-firmware", folder.path().string()}, "is no regular file");
    expectRefusal({"devices", "--falcon-firmware", "/dev/zero"}, "/dev/zero: is no regular file");
    const std::string page = folder / "page";
    writeText(page, "<html>" + std::string(3000, 'x') + "</html>");
    expectRefusal({"devices", "--falcon-firmware", page}, "holds text");
    writeText(page, std::string(3000, '\xff'));
    expectRefusal({"devices", "--falcon-firmware", page}, "holds the byte 0xff and no other");
    writeText(page, "PK\x03\x04" + std::string(3000, '\x01'));
    expectRefusal({"devices", "--falcon-firmware", page}, "holds a ZIP archive");
    expectRefusal({"devices", "--install-udev", "--udev-folder", (folder / "none").string()}, "cannot be written");
}

TEST(DevicesCommand, OptionsOfTheFalconNeedTheFalcon)
{
    expectRefusal({"train", "block", "--no-view", "--on-unplug", "wait"}, "needs --device falcon");
    expectRefusal({"train", "block", "--device", "falcon", "--unpaced"}, "a person holds it");
    expectRefusal({"devices", "--buttons", "--force-test"}, "--buttons");
    expectRefusal({"train", "block", "--device", "falcon", "--trainee", "expert"}, "needs --device hand");
}

}  // namespace
}  // namespace palpate::apps
