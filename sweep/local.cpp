#include <sweep/local.h>

#include <sweep/lock.h>

#include <fmt/format.h>

#include <cstring>
#include <memory>

namespace palpate::sweep {

PoolResult runLocally(SweepFolder& folder, const std::vector<std::size_t>& cases, int jobs, const std::string& build,
                      const std::function<bool(std::size_t, std::size_t)>& told, const std::function<bool()>& abandoned)
{
    PoolWork work;
    work.start = [&] {
        folder.leaveLock();
        const auto runner = std::make_shared<CaseRunner>(folder.plan(), build);
        return [&folder, &cases, &build, runner](std::size_t item) {
            folder.write(runCase(*runner, folder, cases[item], build));
        };
    };
    work.lost = [&](std::size_t item, int signal) {
        SweepRow row;
        row.index = cases[item];
        row.build = build;
        row.machine = machineName();
        row.error = fmt::format("its process was ended by signal {} ({})", signal, strsignal(signal));
        folder.write(row);
    };
    work.told = told;
    work.abandoned = abandoned;
    return runPool(cases.size(), jobs, work);
}

}  // namespace palpate::sweep
