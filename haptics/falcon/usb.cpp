#include <haptics/falcon/usb.h>

#include <base/descriptor.h>
#include <base/error.h>
#include <haptics/falcon/bytes.h>
#include <haptics/falcon/guardian.h>
#include <haptics/falcon/trouble_if.h>

#include <fmt/format.h>

#include <fcntl.h>
#include <libusb-1.0/libusb.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <span>
#include <system_error>
#include <thread>

namespace palpate::falcon {

namespace {

using Clock = std::chrono::steady_clock;

constexpr unsigned controlTime = 1000;  // [ms]
constexpr std::size_t readers = 8, writers = 4;
constexpr int maxErrors = 100;  // of transfers in a row, before the Falcon counts as gone
constexpr int interface = 0;

void check(int result, const char* what)
{
    base::failIf(result < 0, "USB: {}: {}", what, libusb_strerror(static_cast<libusb_error>(result)));
}

// libusb with its lists.
class Context {
public:
    Context() { check(libusb_init(&context_), "cannot be used"); }
    ~Context() { libusb_exit(context_); }
    Context& operator=(Context&&) = delete;

    operator libusb_context*() const noexcept { return context_; }

private:
    libusb_context* context_ = nullptr;
};

// "1-2.3": how the kernel calls the place it is plugged in.
std::string portOf(libusb_device* device)
{
    std::array<std::uint8_t, 8> ports{};
    const int n = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
    std::string port = std::to_string(libusb_get_bus_number(device));
    for (int i = 0; i < n; ++i) {
        port += (i == 0 ? '-' : '.') + std::to_string(ports[static_cast<std::size_t>(i)]);
    }
    return port;
}

std::string boundDriver(const std::string& port)
{
    std::error_code none;
    const std::string link = fmt::format("/sys/bus/usb/devices/{}:1.{}/driver", port, interface);
    const std::string name = std::filesystem::read_symlink(link, none).filename();
    return name == "usbfs" ? "" : name;
}

std::vector<UsbFalcon> falconsOf(libusb_context* context)
{
    libusb_device** devices = nullptr;
    const ssize_t n = libusb_get_device_list(context, &devices);
    check(static_cast<int>(n), "devices cannot be listed");
    std::vector<UsbFalcon> found;
    for (ssize_t i = 0; i < n; ++i) {
        libusb_device_descriptor d{};
        if (libusb_get_device_descriptor(devices[i], &d) < 0 || d.idVendor != vendorId || d.idProduct != productId) {
            continue;
        }
        UsbFalcon falcon;
        falcon.bus = libusb_get_bus_number(devices[i]);
        falcon.address = libusb_get_device_address(devices[i]);
        falcon.node = fmt::format("/dev/bus/usb/{:03}/{:03}", falcon.bus, falcon.address);
        falcon.driver = boundDriver(portOf(devices[i]));
        falcon.allowed = access(falcon.node.c_str(), R_OK | W_OK) == 0;
        found.push_back(falcon);
    }
    libusb_free_device_list(devices, 1);
    return found;
}

class UsbTransport final : public Transport {
public:
    ~UsbTransport() override { close(); }

    void open() override;
    void close() noexcept override;
    void control(Request request, std::uint16_t value) override;
    bool send(std::span<const std::uint8_t> bytes) noexcept override;
    std::size_t receive(std::span<std::uint8_t> into, double seconds) noexcept override;
    bool gone() const noexcept override { return gone_; }
    double now() const noexcept override { return std::chrono::duration<double>(Clock::now().time_since_epoch()).count(); }
    void sleep(double seconds) noexcept override { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }
    int descriptor() const noexcept override { return *descriptor_; }

private:
    struct Slot {
        UsbTransport* owner = nullptr;
        libusb_transfer* transfer = nullptr;
        bool inFlight = false;
        std::array<std::uint8_t, usbPacket> bytes{};
    };

    static void onIn(libusb_transfer* transfer);
    static void onOut(libusb_transfer* transfer);
    void openNode(const UsbFalcon& falcon);
    void makeSlots();
    bool submit(Slot& slot) noexcept;
    bool anyFlying() const noexcept;
    void note(const libusb_transfer& transfer) noexcept;
    void live(double seconds) noexcept;
    void cancelTransfers() noexcept;
    void restart() noexcept;

    Context context_;
    base::Descriptor descriptor_;
    libusb_device_handle* handle_ = nullptr;
    std::array<Slot, readers + writers> slots_;
    std::span<Slot> in_ = std::span(slots_).first(readers), out_ = std::span(slots_).last(writers);
    Bytes bytes_;
    int errors_ = 0;  // of transfers in a row
    bool gone_ = false;
    bool closing_ = false;  // nothing is sent off again
    bool stalled_ = false;  // what comes in, until it is cleared
};

void UsbTransport::open()
{
    close();
    // A context of its own: one that lives learns of what is plugged in from udev only, where that runs.
    const auto falcons = listFalcons();
    troubleIf(falcons.empty(), Cause::absent,
              "no Falcon is plugged in (USB 0403:cb48): plug in its cable and its power supply");
    gone_ = closing_ = stalled_ = false;
    errors_ = 0;
    bytes_.clear();
    try {
        openNode(falcons[0]);
        makeSlots();
    } catch (...) {
        close();
        throw;
    }
}

void UsbTransport::openNode(const UsbFalcon& falcon)
{
    descriptor_ = base::Descriptor(::open(falcon.node.c_str(), O_RDWR | O_CLOEXEC));
    const int error = descriptor_ ? 0 : errno;
    troubleIf(error == EACCES || error == EPERM, Cause::permission,
              "{}: the Falcon is there but may not be opened: run 'sudo palpate devices --install-udev', then plug it in "
              "again",
              falcon.node);
    troubleIf(error != 0, Cause::absent, "{}: the Falcon cannot be opened ({}): plug it in again", falcon.node,
              std::strerror(error));
    check(libusb_wrap_sys_device(context_, *descriptor_, &handle_), "the Falcon cannot be used");
    libusb_set_auto_detach_kernel_driver(handle_, 1);
    const int claimed = libusb_claim_interface(handle_, interface);
    troubleIf(claimed == LIBUSB_ERROR_BUSY, Cause::busy, "{}: another program uses the Falcon{}: end it", falcon.node,
              falcon.driver.empty() ? "" : " (kernel driver " + falcon.driver + ")");
    troubleIf(claimed < 0, Cause::absent, "{}: the Falcon cannot be claimed ({}): plug it in again", falcon.node,
              libusb_strerror(static_cast<libusb_error>(claimed)));
}

void UsbTransport::makeSlots()
{
    for (Slot& slot : in_) {
        slot.owner = this;
        slot.transfer = libusb_alloc_transfer(0);
        libusb_fill_bulk_transfer(slot.transfer, handle_, endpointIn, slot.bytes.data(), usbPacket, onIn, &slot, 0);
        troubleIf(!submit(slot), Cause::absent, "the Falcon cannot be read: plug it in again");
    }
    for (Slot& slot : out_) {
        slot.owner = this;
        slot.transfer = libusb_alloc_transfer(0);
        libusb_fill_bulk_transfer(slot.transfer, handle_, endpointOut, slot.bytes.data(), 0, onOut, &slot, controlTime);
    }
}

bool UsbTransport::submit(Slot& slot) noexcept
{
    const int result = libusb_submit_transfer(slot.transfer);
    slot.inFlight = result == 0;
    gone_ = gone_ || result == LIBUSB_ERROR_NO_DEVICE;
    return slot.inFlight;
}

void UsbTransport::note(const libusb_transfer& transfer) noexcept
{
    switch (transfer.status) {
        case LIBUSB_TRANSFER_COMPLETED:
            errors_ = 0;
            break;
        case LIBUSB_TRANSFER_NO_DEVICE:
            gone_ = true;
            break;
        case LIBUSB_TRANSFER_CANCELLED:
            break;
        case LIBUSB_TRANSFER_STALL:
            stalled_ = true;
            break;
        default:
            gone_ = ++errors_ > maxErrors || gone_;
            break;
    }
}

void UsbTransport::onIn(libusb_transfer* transfer)
{
    Slot& slot = *static_cast<Slot*>(transfer->user_data);
    UsbTransport& wire = *slot.owner;
    slot.inFlight = false;
    wire.note(*transfer);
    if (transfer->status == LIBUSB_TRANSFER_COMPLETED) {
        wire.bytes_.takeTransfer({transfer->buffer, static_cast<std::size_t>(transfer->actual_length)});
    }
    if (!wire.gone_ && !wire.closing_ && !wire.stalled_) {
        wire.submit(slot);
    }
}

void UsbTransport::onOut(libusb_transfer* transfer)
{
    Slot& slot = *static_cast<Slot*>(transfer->user_data);
    slot.inFlight = false;
    slot.owner->note(*transfer);
}

bool UsbTransport::anyFlying() const noexcept
{
    return std::ranges::any_of(slots_, &Slot::inFlight);
}

void UsbTransport::live(double seconds) noexcept
{
    timeval time{};
    time.tv_sec = static_cast<time_t>(seconds);
    time.tv_usec = static_cast<suseconds_t>(1e6 * (seconds - static_cast<double>(time.tv_sec)));
    libusb_handle_events_timeout_completed(context_, &time, nullptr);
}

// Cancels what is on its way and waits for it.
void UsbTransport::cancelTransfers() noexcept
{
    closing_ = true;
    for (const Slot& slot : slots_) {
        if (slot.inFlight) {
            libusb_cancel_transfer(slot.transfer);
        }
    }
    for (int i = 0; anyFlying() && i < 100; ++i) {
        live(0.01);
    }
}

// After a stall of the endpoint, which has to be cleared with nothing on its way.
void UsbTransport::restart() noexcept
{
    cancelTransfers();
    libusb_clear_halt(handle_, endpointIn);
    closing_ = stalled_ = false;
    for (Slot& slot : in_) {
        // One that has not come back yet goes on when it does.
        if (!slot.inFlight) {
            submit(slot);
        }
    }
}

void UsbTransport::close() noexcept
{
    cancelTransfers();
    for (Slot& slot : slots_) {
        // One that never came back is still the kernel's.
        if (!slot.inFlight) {
            libusb_free_transfer(slot.transfer);
        }
        slot.transfer = nullptr;
        slot.inFlight = false;
    }
    if (handle_ != nullptr) {
        libusb_release_interface(handle_, interface);
        libusb_close(handle_);
        handle_ = nullptr;
    }
    descriptor_ = base::Descriptor();
}

void UsbTransport::control(Request request, std::uint16_t value)
{
    constexpr std::uint8_t toVendor = 0x40;
    const int result =
        libusb_control_transfer(handle_, toVendor, static_cast<std::uint8_t>(request), value, 0, nullptr, 0, controlTime);
    if (result == LIBUSB_ERROR_NO_DEVICE) {
        gone_ = true;
        throw Trouble(Cause::unplugged, "the Falcon was unplugged while it was made ready: plug it in and start again");
    }
    troubleIf(
        result < 0, Cause::silent,
        "the Falcon does not take its settings ({}): check its cable, plug it straight into the computer instead of a "
        "hub",
        libusb_strerror(static_cast<libusb_error>(result)));
    // What came in before is thrown away with what the bridge held.
    if (request == Request::reset && value == bridge::purgeIn) {
        live(0.0);
        bytes_.clear();
    }
}

bool UsbTransport::send(std::span<const std::uint8_t> bytes) noexcept
{
    if (gone_ || crashing() || handle_ == nullptr || bytes.size() > usbPacket) {
        return false;
    }
    for (Slot& slot : out_) {
        if (!slot.inFlight) {
            std::copy(bytes.begin(), bytes.end(), slot.bytes.begin());
            slot.transfer->length = static_cast<int>(bytes.size());
            return submit(slot);
        }
    }
    live(0.0);
    return false;
}

std::size_t UsbTransport::receive(std::span<std::uint8_t> into, double seconds) noexcept
{
    const double end = now() + seconds;
    live(0.0);
    while (bytes_.empty() && !gone_ && handle_ != nullptr) {
        if (stalled_) {
            restart();
        }
        const double left = end - now();
        if (left <= 0.0) {
            break;
        }
        live(left);
    }
    return bytes_.give(into);
}

}  // namespace

std::vector<UsbFalcon> listFalcons()
{
    const Context context;
    return falconsOf(context);
}

std::unique_ptr<Transport> usbTransport()
{
    return std::make_unique<UsbTransport>();
}

std::string_view embeddedRule(std::string_view file) noexcept;  // made of the file by the build

std::string udevRule()
{
    return std::string(embeddedRule(udevRuleFile));
}

}  // namespace palpate::falcon
