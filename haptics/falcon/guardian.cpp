#include <haptics/falcon/guardian.h>

#include <haptics/falcon/packet.h>
#include <haptics/falcon/transport.h>

#include <linux/usbdevice_fs.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstring>
#include <ctime>
#include <new>

namespace palpate::falcon {

struct Guardian::Pulse {
    std::atomic<std::uint32_t> beats{0};
    std::atomic<bool> torque{false};
};

namespace {

constexpr int look = 20;              // how often the other process looks [ms]
constexpr unsigned sendTime = 50;     // [ms]
constexpr int guardianPriority = 62;  // above the servo thread
constexpr char another = 'F', none = 'N';
constexpr std::array crashes{SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGABRT};

// What the signal handler may look at.
std::atomic<int> guarded{-1};
std::atomic<bool> crashed{false};
std::array<struct sigaction, crashes.size()> before;

// One packet without torque, by the kernel alone: may be called from a signal handler and after a fork.
void sendRest(int descriptor) noexcept
{
    Packet packet = encode(Command{{}, lampRed, false});
    usbdevfs_bulktransfer bulk{};
    bulk.ep = endpointOut;
    bulk.len = packetBytes;
    bulk.timeout = sendTime;
    bulk.data = packet.data();
    ioctl(descriptor, USBDEVFS_BULK, &bulk);
}

void onCrash(int signal)
{
    crashed = true;
    if (const int descriptor = guarded.exchange(-1); descriptor >= 0) {
        sendRest(descriptor);
        // A thread that was just about to send a torque has sent it by then.
        const timespec moment{0, 3'000'000};
        nanosleep(&moment, nullptr);
        sendRest(descriptor);
    }
    for (std::size_t i = 0; i < crashes.size(); ++i) {
        if (crashes[i] == signal) {
            sigaction(signal, &before[i], nullptr);
        }
    }
    raise(signal);
}

// A message of one byte, with a descriptor or without.
bool sendMessage(int socket, char what, int descriptor) noexcept
{
    iovec part{&what, 1};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> extra{};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    if (descriptor >= 0) {
        message.msg_control = extra.data();
        message.msg_controllen = extra.size();
        cmsghdr* header = CMSG_FIRSTHDR(&message);
        header->cmsg_level = SOL_SOCKET;
        header->cmsg_type = SCM_RIGHTS;
        header->cmsg_len = CMSG_LEN(sizeof(int));
        std::memcpy(CMSG_DATA(header), &descriptor, sizeof(int));
    }
    return sendmsg(socket, &message, MSG_NOSIGNAL) == 1;
}

// The next message; 0 at the end. `descriptor` becomes the one that came with it, or -1.
char receiveMessage(int socket, int& descriptor) noexcept
{
    char what = 0;
    iovec part{&what, 1};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> extra{};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = extra.data();
    message.msg_controllen = extra.size();
    descriptor = -1;
    if (recvmsg(socket, &message, MSG_CMSG_CLOEXEC) <= 0) {
        return 0;
    }
    if (const cmsghdr* header = CMSG_FIRSTHDR(&message); header != nullptr && header->cmsg_type == SCM_RIGHTS) {
        std::memcpy(&descriptor, CMSG_DATA(header), sizeof(int));
    }
    return what;
}

}  // namespace

bool crashing() noexcept
{
    return crashed.load(std::memory_order_relaxed);
}

Guardian::Guardian()
{
    void* shared = mmap(nullptr, sizeof(Pulse), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    std::array<int, 2> ends{-1, -1};
    if (shared != MAP_FAILED && socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) == 0) {
        pulse_ = new (shared) Pulse;
        child_ = fork();
        if (child_ == 0) {
            watch(ends[1]);
            _exit(0);
        }
        ::close(ends[1]);
        socket_ = ends[0];
    }
    struct sigaction action {};
    action.sa_handler = onCrash;
    action.sa_flags = SA_NODEFER;
    for (std::size_t i = 0; i < crashes.size(); ++i) {
        sigaction(crashes[i], &action, &before[i]);
    }
}

Guardian::~Guardian()
{
    guarded = -1;
    for (std::size_t i = 0; i < crashes.size(); ++i) {
        sigaction(crashes[i], &before[i], nullptr);
    }
    if (socket_ >= 0) {
        guard(-1);
        ::close(socket_);
    }
    if (child_ > 0) {
        waitpid(child_, nullptr, 0);
    }
    if (pulse_ != nullptr) {
        munmap(pulse_, sizeof(Pulse));
    }
}

void Guardian::guard(int descriptor) noexcept
{
    guarded = descriptor;
    beat(false);
    if (socket_ >= 0) {
        sendMessage(socket_, descriptor >= 0 ? another : none, descriptor);
    }
}

void Guardian::beat(bool torque) noexcept
{
    if (pulse_ != nullptr) {
        pulse_->torque.store(torque, std::memory_order_relaxed);
        pulse_->beats.fetch_add(1, std::memory_order_relaxed);
    }
}

// The other process: ends when this one does. Allocates nothing, as it was forked from wherever its parent stood.
void Guardian::watch(int socket) noexcept
{
    setsid();  // Ctrl-C and Ctrl-Z are not for it
    prctl(PR_SET_NAME, "palpate-guard");
    sched_param parameters{};
    parameters.sched_priority = guardianPriority;
    sched_setscheduler(0, SCHED_FIFO, &parameters);
    // What its parent has open would stay open for as long as it lives.
    dup2(socket, 0);
    syscall(SYS_close_range, 1U, ~0U, 0U);

    int descriptor = -1;
    std::uint32_t last = 0;
    int unchanged = 0;  // looks in a row
    for (;;) {
        pollfd wait{0, POLLIN, 0};
        if (poll(&wait, 1, look) > 0) {
            int other = -1;
            const char what = receiveMessage(0, other);
            if (what == 0) {
                break;
            }
            if (descriptor >= 0) {
                ::close(descriptor);
            }
            descriptor = other;
            continue;
        }
        const std::uint32_t beats = pulse_->beats.load(std::memory_order_relaxed);
        unchanged = beats == last ? unchanged + 1 : 0;
        last = beats;
        if (descriptor >= 0 && unchanged * look == static_cast<int>(1e3 * patience) &&
            pulse_->torque.load(std::memory_order_relaxed)) {
            sendRest(descriptor);
        }
    }
    if (descriptor >= 0) {
        sendRest(descriptor);
    }
}

}  // namespace palpate::falcon
