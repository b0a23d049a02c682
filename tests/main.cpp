#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <regex>

namespace palpate {
namespace {

constexpr int skippedStatus = 77;  // ctest's SKIP_RETURN_CODE, see skips.cmake

// A test that skips for a reason that is not listed fails.
class Skips : public ::testing::EmptyTestEventListener {
public:
    explicit Skips(const char* reasons) : reasons_(reasons) {}
    bool any() const noexcept { return any_; }

private:
    void OnTestEnd(const ::testing::TestInfo& test) override
    {
        const ::testing::TestResult& result = *test.result();
        if (!result.Skipped()) {
            return;
        }
        any_ = true;
        bool listed = false;
        for (int i = 0; i < result.total_part_count(); ++i) {
            const ::testing::TestPartResult& part = result.GetTestPartResult(i);
            listed = listed || (part.skipped() && std::regex_search(part.message(), reasons_));
        }
        EXPECT_TRUE(listed) << "tests/skips.cmake does not list this reason to skip";
    }

    std::regex reasons_;
    bool any_ = false;
};

// PALPATE_SKIPS: reasons for which a test may skip, a regular expression. Without it any reason will do.
int run(int argc, char** argv)
{
    ::testing::InitGoogleTest(&argc, argv);
    const char* reasons = std::getenv("PALPATE_SKIPS");
    auto* const skips = new Skips(reasons != nullptr ? reasons : "");
    ::testing::UnitTest::GetInstance()->listeners().Append(skips);  // owns it
    const int status = RUN_ALL_TESTS();
    if (::testing::GTEST_FLAG(list_tests)) {
        return status;
    }
    if (::testing::UnitTest::GetInstance()->test_to_run_count() == 0) {
        std::fputs("no test has this name\n", stderr);
        return 1;
    }
    return status == 0 && reasons != nullptr && skips->any() ? skippedStatus : status;
}

}  // namespace
}  // namespace palpate

int main(int argc, char** argv)
{
    return palpate::run(argc, argv);
}
