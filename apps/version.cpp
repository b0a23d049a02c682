#include <apps/version.h>

#include <base/build.h>
#include <studies/kernel/bench_operator.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace palpate::apps {

std::string versionText()
{
    const auto sets = studies::kernelSets();
    return fmt::format("{}\ncompiler   {}\nkernels    {} (this machine runs {})\nlibraries  {}", base::build(),
                       PALPATE_COMPILER, fmt::join(sets.built, ", "), fmt::join(sets.runs, ", "), PALPATE_LIBRARIES);
}

}  // namespace palpate::apps
