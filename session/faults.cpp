#include <session/faults.h>

#include <base/error.h>
#include <base/folds.h>
#include <base/quantities.h>
#include <haptics/simulation.h>

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <system_error>
#include <utility>

namespace palpate::session {

namespace {

using haptics::tickSeconds;

constexpr double latestStart = 86400.0;  // [s]
constexpr double longest = 10.0;         // [s]
constexpr double maxLate = 1.0;          // [s]
constexpr double furthestJump = 1.0;     // [m]

// What a fault is called, and what it is when nothing more is said. The amount of the others is their length.
struct Form {
    std::string_view name;
    Fault standard;
};
constexpr double forever = std::numeric_limits<double>::infinity();
constexpr std::array forms{Form{"gap", {FaultKind::gap, 0.0, 50e-3}},
                           Form{"late", {FaultKind::late, 5e-3, 0.5}},
                           Form{"nan", {FaultKind::nan, 0.0, tickSeconds}},
                           Form{"jump", {FaultKind::jump, 100e-3, 20e-3}},
                           Form{"unplug", {FaultKind::unplug, 0.0, 0.2}},
                           Form{"stall-viewer", {FaultKind::stallViewer, 0.0, 1.0}},
                           Form{"disk-full", {FaultKind::diskFull, 0.0, forever}}};

[[noreturn]] void refuse(const std::string& text)
{
    throw base::error(
        "--inject: {}: must be WHAT[=AMOUNT][/LENGTH]@TIME with a unit to every number, as gap=50ms@2s, "
        "late=5ms/500ms@2s, nan@2s, jump=100mm/20ms@2s, unplug=200ms@2s, stall-viewer=1s@2s, disk-full@2s",
        text);
}

// What stands behind the last `mark` in `text`, which it takes off.
std::optional<std::string> takeOff(std::string& text, char mark)
{
    const auto at = text.rfind(mark);
    if (at == std::string::npos) {
        return std::nullopt;
    }
    std::string tail = text.substr(at + 1);
    text.resize(at);
    return tail;
}

double within(const std::optional<double>& value, double most, const std::string& text, std::string_view what,
              std::string_view unit)
{
    if (!value) {
        refuse(text);
    }
    base::failIf(!(*value > 0.0 && *value <= most), "--inject: {}: its {} must be over 0 and up to {:g} {}", text, what,
                 most, unit);
    return *value;
}

Fault parseFault(const std::string& text)
{
    std::string rest = text;
    const auto start = takeOff(rest, '@');
    const auto length = takeOff(rest, '/');
    const auto amount = takeOff(rest, '=');
    const auto* const form = std::ranges::find(forms, std::string_view(rest), &Form::name);
    if (form == forms.end() || !start) {
        refuse(text);
    }
    Fault fault = form->standard;
    const bool hasAmount = fault.amount > 0.0;
    if ((fault.kind == FaultKind::diskFull && (amount || length)) || (!hasAmount && amount && length)) {
        refuse(text);
    }
    fault.start = within(base::timeOf(*start), latestStart, text, "time", "s");
    if (amount && fault.kind == FaultKind::jump) {
        fault.amount = within(base::lengthOf(*amount), furthestJump, text, "amount", "m");
    } else if (amount && hasAmount) {
        fault.amount = within(base::timeOf(*amount), maxLate, text, "amount", "s");
    }
    if (const auto& time = hasAmount ? length : amount ? amount : length) {
        fault.length = within(base::timeOf(*time), longest, text, "length", "s");
    }
    return fault;
}

std::uint64_t ticksOf(double seconds) noexcept
{
    return static_cast<std::uint64_t>(std::llround(seconds / tickSeconds));
}

bool activeAt(const Fault& fault, std::uint64_t tick) noexcept
{
    const auto first = ticksOf(fault.start);
    return tick >= first && (std::isinf(fault.length) || tick < first + std::max<std::uint64_t>(ticksOf(fault.length), 1));
}

void sleepFor(double seconds) noexcept
{
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

// The process's files stay as large as the record's log is while it lives: to a writer this is a full disk.
class NoRoom {
public:
    explicit NoRoom(const std::filesystem::path& record)
    {
        std::error_code missing;
        const auto size = std::filesystem::file_size(record.string() + "-wal", missing);
        getrlimit(RLIMIT_FSIZE, &before_);
        const rlimit limit{missing ? rlim_t{0} : static_cast<rlim_t>(size), before_.rlim_max};
        setrlimit(RLIMIT_FSIZE, &limit);
    }
    ~NoRoom() { setrlimit(RLIMIT_FSIZE, &before_); }
    NoRoom& operator=(NoRoom&&) = delete;

private:
    rlimit before_{};
};

}  // namespace

Faults parseFaults(const std::string& text)
{
    Faults faults;
    for (std::size_t at = 0; at <= text.size();) {
        const auto end = std::min(text.find(',', at), text.size());
        faults.push_back(parseFault(text.substr(at, end - at)));
        at = end + 1;
    }
    return faults;
}

bool has(const Faults& faults, FaultKind kind) noexcept
{
    return std::ranges::any_of(faults, [kind](const Fault& f) { return f.kind == kind; });
}

double gapAfter(const Faults& faults, std::uint64_t tick) noexcept
{
    return base::sumOf(faults, [&](const Fault& fault) {
        return fault.kind == FaultKind::gap && ticksOf(fault.start) == tick ? fault.length : 0.0;
    });
}

FaultyDevice::FaultyDevice(std::unique_ptr<haptics::Device> device, Faults faults)
    : device_(std::move(device)), faults_(std::move(faults))
{
}

const Fault* FaultyDevice::active(FaultKind kind) const noexcept
{
    const auto found = std::ranges::find_if(
        faults_, [&](const Fault& f) { return f.kind == kind && tick_ > 0 && activeAt(f, tick_ - 1); });
    return found == faults_.end() ? nullptr : &*found;
}

// Time that passes for the hand between two ticks.
void FaultyDevice::advance(double seconds) noexcept
{
    for (auto n = ticksOf(seconds); n > 0 && !device_->finished(); --n) {
        device_->read();
    }
}

haptics::DeviceSample FaultyDevice::read() noexcept
{
    if (tick_ > 0) {
        advance(gapAfter(faults_, tick_ - 1));
    }
    ++tick_;
    if (device_->finished()) {
        last_.fresh = false;
        return last_;
    }
    haptics::DeviceSample sample = device_->read();
    if (active(FaultKind::unplug) != nullptr) {
        last_.fresh = false;
        return last_;
    }
    last_ = sample;
    if (const Fault* jump = active(FaultKind::jump)) {
        sample.position += jump->amount * sample.axis;
    }
    if (active(FaultKind::nan) != nullptr) {
        sample.position = Vec3(std::numeric_limits<double>::quiet_NaN());
    }
    return sample;
}

void FaultyDevice::write(Vec3 force) noexcept
{
    if (const Fault* late = active(FaultKind::late)) {
        sleepFor(late->amount);
        advance(late->amount);
    }
    device_->write(active(FaultKind::unplug) != nullptr ? Vec3(0.0) : force);
}

FaultsAround::FaultsAround(Faults faults, std::filesystem::path record, std::function<void(bool)> stall)
    : stall_(std::move(stall)),
      thread_([this, faults = std::move(faults), record = std::move(record)] { work(faults, record); })
{
}

FaultsAround::~FaultsAround()
{
    over_ = true;
    thread_.join();
}

void FaultsAround::work(const Faults& faults, const std::filesystem::path& record)
{
    const auto any = [&](FaultKind kind, std::uint64_t tick) {
        return std::ranges::any_of(faults, [&](const Fault& f) { return f.kind == kind && activeAt(f, tick); });
    };
    std::optional<NoRoom> full;
    bool stalled = false;
    while (!over_) {
        const std::uint64_t tick = tick_.load(std::memory_order_relaxed);
        if (!full && any(FaultKind::diskFull, tick)) {
            full.emplace(record);
        }
        if (stall_ && any(FaultKind::stallViewer, tick) != stalled) {
            stalled = !stalled;
            stall_(stalled);
        }
        sleepFor(tickSeconds);
    }
    if (stalled) {
        stall_(false);
    }
}

}  // namespace palpate::session
