#pragma once

#include <tests/falcon/emulator.h>

#include <linux/usbdevice_fs.h>
#include <umockdev.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

namespace palpate::falcon {

inline constexpr const char* usbNode = "/dev/bus/usb/001/002";

/// usbfs as libusb 1.0.26 asks it; each function answers one ioctl. One Falcon, for this process and for those that it
/// starts.
class Kernel {
public:
    explicit Kernel(Emulator& device);
    ~Kernel();
    Kernel(const Kernel&) = delete;
    Kernel& operator=(const Kernel&) = delete;

    std::atomic<bool> gone{false}, claimed{false}, refuseClaim{false}, stalled{false};
    std::atomic<bool> keepsOne{false};  // of what is read, whatever happens

private:
    // The head of usbdevfs_urb, which ends in an array without a length.
    struct Header {
        unsigned char type, endpoint;
        int status;
        unsigned flags;
        void* buffer;
        int bufferLength, actualLength;
    };
    static_assert(offsetof(Header, actualLength) == offsetof(usbdevfs_urb, actual_length));
    struct Urb {
        UMockdevIoctlData* self = nullptr;
        UMockdevIoctlData* buffer = nullptr;
        gulong user = 0;
        Header content{};
    };

    static gboolean onIoctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self);
    void answer(UMockdevIoctlClient* client);
    void submit(UMockdevIoctlClient* client, UMockdevIoctlData* argument);
    void reap(UMockdevIoctlClient* client, UMockdevIoctlData* argument);
    void discard(UMockdevIoctlClient* client, UMockdevIoctlData* argument);
    void control(Urb urb);
    void finish(Urb urb, int status, const std::vector<std::uint8_t>& data, std::size_t length);
    void live();
    static std::vector<std::uint8_t> bytesOf(UMockdevIoctlData* data);
    static void write(UMockdevIoctlData* data, gsize offset, std::vector<std::uint8_t> bytes);

    Emulator& device_;
    UMockdevTestbed* bed_;
    UMockdevIoctlBase* handler_;
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
    std::deque<Urb> reading_, done_;
    UMockdevIoctlClient* owner_ = nullptr;  // who has claimed it
};

}  // namespace palpate::falcon
