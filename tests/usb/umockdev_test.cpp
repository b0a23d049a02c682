// The libusb transport against a kernel that umockdev plays: every ioctl of usbfs is answered here by an emulated Falcon.
// Run it under umockdev-wrapper.
#include <haptics/falcon/link.h>
#include <haptics/falcon/usb.h>
#include <tests/falcon/rig.h>
#include <tests/usb/kernel.h>

#include <gtest/gtest.h>

#include <malloc.h>

#include <atomic>
#include <memory>
#include <string>

namespace palpate::falcon {
namespace {

const std::atomic<bool> never{false};

struct Bench {
    Bench() : device(syntheticFirmware(600).image), kernel(device), wire(usbTransport()) {}

    Emulator device;
    Kernel kernel;
    std::unique_ptr<Transport> wire;
};

TEST(FalconUsb, IsFoundWithItsNode)
{
    const Bench bench;
    const auto falcons = listFalcons();
    ASSERT_EQ(falcons.size(), 1U);
    EXPECT_EQ(falcons[0].node, usbNode);
    EXPECT_EQ(falcons[0].bus, 1);
    EXPECT_EQ(falcons[0].address, 2);
    EXPECT_TRUE(falcons[0].allowed);
}

TEST(FalconUsb, NoneIsThereWithoutIt)
{
    UMockdevTestbed* bed = umockdev_testbed_new();
    EXPECT_TRUE(listFalcons().empty());
    try {
        usbTransport()->open();
        ADD_FAILURE() << "it opened nothing";
    } catch (const Trouble& trouble) {
        EXPECT_EQ(trouble.cause(), Cause::absent);
    }
    g_object_unref(bed);
}

TEST(FalconUsb, LoadsHomesAndExchangesPackets)
{
    Bench bench;
    Link link(*bench.wire, {syntheticFirmware(600)}, [](const std::string&) {});
    Emulator& device = bench.device;
    device.hand.speed = 1.0;
    device.hand.goal = {0.005, -0.003, 0.145};
    link.connect(never);
    EXPECT_TRUE(bench.kernel.claimed);
    for (int i = 0; i < 200; ++i) {
        link.exchange({});
    }
    EXPECT_GE(link.counts().exchanges, 190U);
    link.rest();
    link.close();
    EXPECT_FALSE(bench.kernel.claimed) << "given back";
    EXPECT_EQ(device.command().motor, Triple{});
}

// A stalled endpoint says nothing more until it is cleared.
TEST(FalconUsb, StallsOfTheEndpointAreCleared)
{
    Bench bench;
    bench.device.makeReady();
    Link link(*bench.wire, {std::nullopt, 0.0, false}, [](const std::string&) {});
    link.connect(never);
    for (int i = 0; i < 5; ++i) {
        bench.kernel.stalled = true;
        for (int n = 0; n < 20; ++n) {
            link.exchange({});
        }
    }
    EXPECT_GE(link.counts().exchanges, 80U);
    EXPECT_FALSE(bench.wire->gone());
}

// A kernel that does not give a transfer back, whether it is cancelled or not: it is neither sent off a second time nor
// freed.
TEST(FalconUsb, ATransferThatDoesNotComeBackIsLeftAlone)
{
    Bench bench;
    bench.device.makeReady();
    Link link(*bench.wire, {std::nullopt, 0.0, false}, [](const std::string&) {});
    link.connect(never);
    mallopt(M_PERTURB, 0x55);  // what is freed cannot be used on
    bench.kernel.keepsOne = true;
    bench.kernel.stalled = true;
    for (int n = 0; n < 20; ++n) {
        link.exchange({});
    }
    EXPECT_GE(link.counts().exchanges, 10U);
    link.close();
    EXPECT_FALSE(bench.kernel.claimed);
    mallopt(M_PERTURB, 0);
    bench.kernel.keepsOne = false;
    link.connect(never);
    EXPECT_TRUE(link.exchange({}));
}

TEST(FalconUsb, UnpluggingIsNoticed)
{
    Bench bench;
    bench.device.makeReady();
    Link link(*bench.wire, {std::nullopt, 0.0, false}, [](const std::string&) {});
    link.connect(never);
    ASSERT_TRUE(link.exchange({}));
    bench.kernel.gone = true;
    for (int i = 0; i < 10 && !bench.wire->gone(); ++i) {
        link.exchange({});
    }
    EXPECT_TRUE(bench.wire->gone());
    EXPECT_TRUE(link.lost());
}

TEST(FalconUsb, ClaimedByAnotherItSaysSo)
{
    Bench bench;
    bench.kernel.refuseClaim = true;
    try {
        bench.wire->open();
        ADD_FAILURE() << "it was claimed";
    } catch (const Trouble& trouble) {
        EXPECT_EQ(trouble.cause(), Cause::busy);
        EXPECT_NE(std::string(trouble.what()).find("another program"), std::string::npos);
    }
}

}  // namespace
}  // namespace palpate::falcon
