#pragma once

namespace palpate::falcon {

/// Sees to it that no Falcon is left under torque by a program that ends or stands still.
///
/// A crash (SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGABRT) is caught by a signal handler that sends one packet without torque
/// and lets the signal go on. What no handler can catch (SIGKILL, SIGSTOP, a machine that is too busy) is seen by a process
/// of its own: it shares the Falcon's file descriptor, and sends that packet when this process is gone, or has sent nothing
/// for `patience` while torque was on. Both go by the kernel (usbfs), not by libusb, whose locks may be held.
///
/// From the handler's first moment on crashing() is true, so that no other thread sends a torque after that packet.
/// One at a time in a process. Make it before threads and before what takes much memory: it forks.
class Guardian {
public:
    static constexpr double patience = 0.1;  // [s]

    Guardian();
    ~Guardian();
    Guardian& operator=(Guardian&&) = delete;

    /// The Falcon behind this descriptor is the one to guard from now on; -1: none.
    void guard(int descriptor) noexcept;
    /// After every packet: whether it put torque on.
    void beat(bool torque) noexcept;

    /// The other process; -1 where none could be started.
    int pid() const noexcept { return child_; }

private:
    struct Pulse;  // shared by the two processes
    void watch(int socket) noexcept;

    Pulse* pulse_ = nullptr;
    int socket_ = -1;
    int child_ = -1;
};

/// This process is ending by a signal that it could not go on after: nothing but the handler sends any more.
bool crashing() noexcept;

}  // namespace palpate::falcon
