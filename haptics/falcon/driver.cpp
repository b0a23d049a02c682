#include <haptics/falcon/driver.h>

#include <haptics/falcon/trouble_if.h>

#include <sched.h>
#include <sys/prctl.h>

#include <exception>
#include <utility>

namespace palpate::falcon {

namespace {

constexpr int driverPriority = 61;     // above the servo thread: it works for microseconds and waits for the wire
constexpr double betweenTries = 0.25;  // for a Falcon that is to come back [s]

}  // namespace

Driver::Driver(std::unique_ptr<Transport> wire, DriverOptions options, Say say, const std::atomic<bool>& stop)
    : wire_(std::move(wire)), options_(std::move(options)), say_(std::move(say)), link_(*wire_, options_.link, say_)
{
    if (options_.guardian) {
        guardian_ = std::make_unique<Guardian>();
    }
    link_.connect(stop);
    guard(wire_->descriptor());
    pose_.write(link_.pose());
    thread_ = std::thread([this] { run(); });
}

Driver::~Driver()
{
    stop_ = true;
    if (thread_.joinable()) {
        thread_.join();
    }
    guard(-1);
    link_.close();
}

void Driver::guard(int descriptor) noexcept
{
    if (guardian_) {
        guardian_->guard(descriptor);
    }
}

void Driver::write(Vec3 force, bool engaged) noexcept
{
    order_.write({force, wire_->now(), engaged ? 1U : 0U});
}

std::string Driver::problem() const
{
    const std::lock_guard lock(guard_);
    return problem_;
}

LinkCounts Driver::counts() const noexcept
{
    LinkCounts counts;
    counts_.read(counts);
    return counts;
}

void Driver::run() noexcept
{
    sched_param parameters{};
    parameters.sched_priority = driverPriority;
    sched_setscheduler(0, SCHED_FIFO, &parameters);
    prctl(PR_SET_TIMERSLACK, 1UL);
    try {
        talk();
    } catch (const std::exception& e) {
        const std::lock_guard lock(guard_);
        problem_ = e.what();
    }
    link_.rest();
    ended_.store(true, std::memory_order_release);
}

void Driver::talk()
{
    ForceOrder order;
    bool frozen = false;
    while (!stop_) {
        order_.read(order);
        if (link_.exchange(order)) {
            pose_.write(link_.pose());
        }
        counts_.write(link_.counts());
        if (guardian_) {
            guardian_->beat(link_.command().motor != Triple{});
        }
        if (link_.frozen() != frozen) {
            frozen = !frozen;
            say_(frozen ? "the Falcon's encoders stand still under a force: the force is off until they move"
                        : "the Falcon's encoders move again");
        }
        if (link_.lost() && !recover()) {
            return;
        }
    }
}

// Brings a Falcon back that went away; false when the program is to end before that.
bool Driver::recover()
{
    const bool unplugged = wire_->gone();
    guard(-1);
    link_.rest();
    link_.close();
    const std::string what = unplugged ? "the Falcon was unplugged" : "the Falcon stopped answering";
    troubleIf(unplugged && options_.onUnplug == OnUnplug::exit, Cause::unplugged,
              "{}: the force is off; plug it in and start again (--on-unplug wait goes on by itself)", what);
    say_(what +
         (unplugged ? ": the force is off; plug it in again and the session goes on" : ": the force is off; trying again"));
    while (!stop_) {
        try {
            link_.connect(stop_);
            guard(wire_->descriptor());
            say_("the Falcon is back");
            return true;
        } catch (const Trouble& trouble) {
            const Cause cause = trouble.cause();
            const bool comesAndGoes = cause == Cause::absent || cause == Cause::unplugged || cause == Cause::permission;
            if (cause == Cause::interrupted) {
                return false;
            }
            if (!(options_.onUnplug == OnUnplug::wait && comesAndGoes)) {
                throw;
            }
            wire_->sleep(betweenTries);
        }
    }
    return false;
}

}  // namespace palpate::falcon
