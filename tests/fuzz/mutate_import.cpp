// mutate_import DATA [--minutes M | --count N] [--seed S]
// Imports mutated copies of the files in DATA. A crash ends the program (the file is left where it says); so does a file
// that takes over ten seconds. Exit status 1 for any fault.
#include "mutation.h"

#include <fmt/format.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <ctime>

namespace {

using Clock = std::chrono::steady_clock;

void hangs(int)
{
    constexpr char said[] = "mutate_import: over ten seconds for one file\n";
    [[maybe_unused]] const auto written = ::write(2, said, sizeof said - 1);
    std::abort();
}

// Ten seconds of work, or a hundred in which nothing is done, from now on; none for 0.
void watch(int on)
{
    const itimerval work{{0, 0}, {10 * on, 0}};
    ::setitimer(ITIMER_PROF, &work, nullptr);
    ::alarm(static_cast<unsigned>(100 * on));
}

double processorTime()
{
    return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

struct Options {
    std::string data;
    double minutes = 0;
    unsigned long count = 10000;
    unsigned seed = 1;
};

Options parsed(int argc, char** argv)
{
    Options options;
    for (int i = 1; i < argc; ++i) {
        const std::string argument = argv[i];
        const char* value = i + 1 < argc ? argv[i + 1] : "";
        if (argument == "--minutes") {
            options.minutes = std::atof(value);
            ++i;
        } else if (argument == "--count") {
            options.count = std::strtoul(value, nullptr, 10);
            ++i;
        } else if (argument == "--seed") {
            options.seed = static_cast<unsigned>(std::strtoul(value, nullptr, 10));
            ++i;
        } else {
            options.data = argument;
        }
    }
    return options;
}

}  // namespace

int main(int argc, char** argv)
{
    const Options options = parsed(argc, argv);
    const auto seeds = palpate::fuzz::seeds(options.data, 200000);
    if (seeds.empty()) {
        fmt::print(stderr, "mutate_import: {}: no volumes there: name the folder with test data\n", options.data);
        return 2;
    }
    const auto folder = std::filesystem::temp_directory_path() / fmt::format("palpate-mutate-{}", ::getpid());
    fmt::print("{} files, seed {}, copies in {}\n", seeds.size(), options.seed, folder.string());
    std::signal(SIGALRM, hangs);
    std::signal(SIGPROF, hangs);
    const auto start = Clock::now();
    const auto elapsed = [&] { return std::chrono::duration<double>(Clock::now() - start).count(); };
    unsigned long tried = 0, taken = 0, faults = 0;
    double slowest = 0;
    for (; tried < options.count || elapsed() < 60 * options.minutes; ++tried) {
        std::mt19937 random(options.seed + static_cast<unsigned>(tried));
        const auto& seed = seeds[random() % seeds.size()];
        const double before = processorTime();
        std::filesystem::remove_all(folder);
        watch(1);
        const auto outcome = palpate::fuzz::tryOne(seed, random, folder);
        watch(0);
        slowest = std::max(slowest, processorTime() - before);
        taken += outcome.taken ? 1 : 0;
        if (!outcome.fault.empty()) {
            ++faults;
            fmt::print("copy {} of {}: {}\n", tried, seed.file.string(), outcome.fault);
        }
        if ((tried + 1) % 1000 == 0) {
            fmt::print("{} copies, {} faults\n", tried + 1, faults);
            std::fflush(stdout);
        }
    }
    std::filesystem::remove_all(folder);
    fmt::print("{} mutated files in {:.0f} s: {} taken, {} refused, {} faults; slowest {:.2f} s of processor time\n", tried,
               elapsed(), taken, tried - taken, faults, slowest);
    return faults == 0 ? 0 : 1;
}
