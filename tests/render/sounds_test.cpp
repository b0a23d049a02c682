#include <render/sounds.h>

#include <base/inputs.h>
#include <tests/folder.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

namespace palpate::render {
namespace {

// Of a beep: half its changes of sign, by its length.
double hertzOf(const std::vector<std::int16_t>& samples)
{
    std::size_t crossings = 0, sounding = 0;
    for (std::size_t i = 1; i < samples.size(); ++i) {
        crossings += (samples[i - 1] < 0) != (samples[i] < 0) ? 1 : 0;
        sounding += samples[i] != 0 ? 1 : 0;
    }
    return 0.5 * static_cast<double>(crossings) * sampleRate / static_cast<double>(std::max<std::size_t>(sounding, 1));
}

TEST(Sounds, AWarningThatIsMoreUrgentIsHigherAndLonger)
{
    EXPECT_TRUE(soundOf(channel::Warning::none).empty());
    const auto near = soundOf(channel::Warning::near), veryNear = soundOf(channel::Warning::veryNear),
               touching = soundOf(channel::Warning::touching);
    EXPECT_NEAR(hertzOf(near), 660, 20);
    EXPECT_NEAR(hertzOf(veryNear), 880, 30);
    EXPECT_NEAR(hertzOf(touching), 1175, 40);
    EXPECT_EQ(veryNear.size(), 2 * near.size());
    EXPECT_EQ(touching.size(), 3 * near.size());
    // No click: it begins and ends with nothing.
    EXPECT_EQ(near.front(), 0);
    EXPECT_EQ(near.back(), 0);
}

// ALSA writes what would be heard to a file.
TEST(Sounds, AreHeardOnceWhenAWarningBecomesMoreUrgent)
{
    const tests::Folder folder;
    const std::string heard = (folder / "heard.raw").string(), config = (folder / "asound.conf").string();
    std::ofstream(config) << "pcm.!default { type file slave.pcm null file \"" << heard << "\" format raw }\n"
                          << "pcm.null { type null }\n";
    ::setenv("ALSA_CONFIG_PATH", config.c_str(), 1);
    const auto bytes = [&] { return base::contentOf(heard).value_or("").size(); };
    std::string said;
    {
        Sounds sounds([&](const std::string& why) { said = why; });
        channel::State state;
        sounds.heed(state);
        state.warning = channel::Warning::near;
        for (int i = 0; i < 3; ++i)
            sounds.heed(state);
        for (int i = 0; i < 200 && bytes() == 0; ++i)
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    EXPECT_EQ(said, "");
    const std::size_t once = 2 * soundOf(channel::Warning::near).size();
    EXPECT_GE(bytes(), once);
    EXPECT_LT(bytes(), 2 * once);
}

TEST(Sounds, WithoutASoundCardItIsSaidOnce)
{
    const tests::Folder folder;
    const std::string config = (folder / "asound.conf").string();
    std::ofstream(config) << "pcm.!default { type hw card 31 }\n";
    ::setenv("ALSA_CONFIG_PATH", config.c_str(), 1);
    std::vector<std::string> said;
    {
        Sounds sounds([&](const std::string& why) { said.push_back(why); });
        channel::State state;
        state.warning = channel::Warning::touching;
        sounds.heed(state);
        std::this_thread::sleep_for(std::chrono::milliseconds(500));
    }
    ASSERT_EQ(said.size(), 1U);
    EXPECT_EQ(said[0].find("no sounds: "), 0U);
}

}  // namespace
}  // namespace palpate::render
