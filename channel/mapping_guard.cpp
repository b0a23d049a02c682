#include <channel/mapping_guard.h>

#include <base/error.h>
#include <signal.h>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <mutex>

namespace palpate::channel {
namespace {

// A signal handler can reach nothing else.
struct Slot {
    std::atomic<bool> taken{false};
    std::atomic<std::uintptr_t> base{0};  // 0: not guarded (yet)
    std::atomic<std::size_t> bytes{0};
    std::atomic<bool> torn{false};
};
static_assert(std::atomic<std::uintptr_t>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);

std::array<Slot, 64> slots;
struct sigaction before {};

// Memory of our own in the place of the whole mapping: the access that failed is tried again and finds zeros.
bool mend(Slot& slot, std::uintptr_t address) noexcept
{
    const std::uintptr_t base = slot.base.load(std::memory_order_acquire);
    const std::size_t bytes = slot.bytes.load(std::memory_order_acquire);
    if (base == 0 || address < base || address - base >= bytes)
        return false;
    // NOLINTNEXTLINE: the address of a mapping
    void* place = reinterpret_cast<void*>(base);
    if (::mmap(place, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED | MAP_NORESERVE, -1, 0) ==
        MAP_FAILED)
        return false;
    slot.torn.store(true, std::memory_order_release);
    return true;
}

void onBusError(int signal, siginfo_t* info, void* context)
{
    const auto address = reinterpret_cast<std::uintptr_t>(info->si_addr);
    for (Slot& slot : slots)
        if (mend(slot, address))
            return;
    if ((before.sa_flags & SA_SIGINFO) != 0 && before.sa_sigaction != nullptr) {
        before.sa_sigaction(signal, info, context);
    } else if (before.sa_handler != SIG_DFL && before.sa_handler != SIG_IGN) {
        before.sa_handler(signal);
    } else {
        ::signal(SIGBUS, SIG_DFL);  // the access fails again, and ends the process as it would have
    }
}

void install()
{
    static std::once_flag once;
    std::call_once(once, [] {
        struct sigaction action {};
        action.sa_sigaction = onBusError;
        action.sa_flags = SA_SIGINFO | SA_NODEFER;
        sigemptyset(&action.sa_mask);
        ::sigaction(SIGBUS, &action, &before);
    });
}

}  // namespace

Mapping::Mapping(int file, std::size_t bytes, int protection, std::uint64_t offset, int flags)
{
    install();
    const auto free = std::ranges::find_if(slots, [](Slot& slot) { return !slot.taken.exchange(true); });
    base::failIf(free == slots.end(), "too many sessions are looked at in one process");
    void* mapped = ::mmap(nullptr, bytes, protection, MAP_SHARED | flags, file, static_cast<off_t>(offset));
    if (mapped == MAP_FAILED) {
        free->taken.store(false);
        return;
    }
    slot_ = static_cast<int>(free - slots.begin());
    free->torn.store(false);
    free->bytes.store(bytes);
    free->base.store(reinterpret_cast<std::uintptr_t>(mapped), std::memory_order_release);
}

Mapping::~Mapping()
{
    if (slot_ < 0)
        return;
    Slot& slot = slots[static_cast<std::size_t>(slot_)];
    std::byte* const mapped = base();
    const std::size_t bytes = slot.bytes.load();
    slot.base.store(0, std::memory_order_release);
    slot.taken.store(false, std::memory_order_release);
    ::munmap(mapped, bytes);
}

std::byte* Mapping::base() const noexcept
{
    // NOLINTNEXTLINE: the address of a mapping
    return reinterpret_cast<std::byte*>(slots[static_cast<std::size_t>(slot_)].base.load(std::memory_order_acquire));
}

bool Mapping::torn() const noexcept
{
    return slot_ >= 0 && slots[static_cast<std::size_t>(slot_)].torn.load(std::memory_order_acquire);
}

}  // namespace palpate::channel
