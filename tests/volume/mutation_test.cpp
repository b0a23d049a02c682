// A small part of scripts/fuzz-import, the same in every run.
#include <tests/fuzz/mutation.h>
#include <tests/volume/files.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

namespace palpate::fuzz {
namespace {

TEST(Mutation, DamagedCopiesOfRealFilesAreTakenOrRefusedOnOneLine)
{
    if (!std::filesystem::exists(PALPATE_TEST_DATA)) {
        GTEST_SKIP() << "no test volumes in " << PALPATE_TEST_DATA;
    }
    const auto files = seeds(PALPATE_TEST_DATA, 20000);
    ASSERT_GT(files.size(), 100U);
    volume::loadDicomDictionary();
    const auto folder = std::filesystem::temp_directory_path() / fmt::format("palpate-mutation-{}", ::getpid());
    std::size_t taken = 0, refused = 0;
    for (unsigned i = 0; i < 600; ++i) {
        std::mt19937 random(i);
        const Seed& seed = files[i % files.size()];
        const Outcome outcome = tryOne(seed, random, folder);
        EXPECT_EQ(outcome.fault, "") << seed.file << " copy " << i;
        (outcome.taken ? taken : refused) += 1;
        std::filesystem::remove_all(folder);
    }
    // Damage to a name or a spare byte does no harm; most of it must be seen.
    EXPECT_GT(taken, 50U);
    EXPECT_GT(refused, 200U);
}

}  // namespace
}  // namespace palpate::fuzz
