#include <tests/usb/kernel.h>

#include <sys/ioctl.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <string>

namespace palpate::falcon {

namespace {

// Questions come in a thread of umockdev's, also while a kernel ends: a program that was killed is still being let go.
std::mutex asking;
const Kernel* alive = nullptr;

}  // namespace

Kernel::Kernel(Emulator& device) : device_(device), bed_(umockdev_testbed_new()), handler_(umockdev_ioctl_base_new())
{
    std::array<std::uint8_t, 50> descriptors{18,   1, 0, 2,  0,    0, 0,  8, 0x03, 0x04, 0x48, 0xCB, 0, 4,  1, 2,    3,
                                             1,    9, 2, 32, 0,    1, 1,  0, 0x80, 45,   9,    4,    0, 0,  2, 0xFF, 0xFF,
                                             0xFF, 0, 7, 5,  0x81, 2, 64, 0, 0,    7,    5,    0x02, 2, 64, 0, 0};
    gchar* path = umockdev_testbed_add_device(
        bed_, "usb", "1-1", nullptr, "busnum", "1", "devnum", "2", "speed", "12", "idVendor", "0403", "idProduct", "cb48",
        "bConfigurationValue", "1", "bNumConfigurations", "1", nullptr, "DEVTYPE", "usb_device", "DEVNAME", usbNode,
        "BUSNUM", "001", "DEVNUM", "002", "MAJOR", "189", "MINOR", "1", nullptr);
    umockdev_testbed_set_attribute_binary(bed_, path, "descriptors", descriptors.data(), descriptors.size());
    g_free(path);
    gchar* root = umockdev_testbed_get_root_dir(bed_);
    const std::filesystem::path file = std::string(root) + usbNode;
    g_free(root);
    std::filesystem::create_directories(file.parent_path());
    g_file_set_contents(file.c_str(), reinterpret_cast<const gchar*>(descriptors.data()), descriptors.size(), nullptr);
    {
        const std::lock_guard lock(asking);
        alive = this;
    }
    g_signal_connect(handler_, "handle-ioctl", G_CALLBACK(onIoctl), this);
    umockdev_testbed_attach_ioctl(bed_, usbNode, handler_, nullptr);
}

Kernel::~Kernel()
{
    {
        const std::lock_guard lock(asking);
        alive = nullptr;
    }
    umockdev_testbed_detach_ioctl(bed_, usbNode, nullptr);
    g_object_unref(handler_);
    g_object_unref(bed_);
}

std::vector<std::uint8_t> Kernel::bytesOf(UMockdevIoctlData* data)
{
    guint8* bytes = nullptr;
    gint count = 0;
    umockdev_ioctl_data_retrieve(data, &bytes, &count);
    std::vector<std::uint8_t> copy(bytes, bytes + count);
    g_free(bytes);
    return copy;
}

void Kernel::write(UMockdevIoctlData* data, gsize offset, std::vector<std::uint8_t> bytes)
{
    umockdev_ioctl_data_update(data, offset, bytes.data(), static_cast<gint>(bytes.size()));
}

void Kernel::finish(Urb urb, int status, const std::vector<std::uint8_t>& data, std::size_t length)
{
    if (!data.empty()) {
        const gsize offset = urb.content.type == USBDEVFS_URB_TYPE_CONTROL ? 8 : 0;
        write(urb.buffer, offset, data);
    }
    const auto put = [&](std::size_t offset, int value) {
        std::vector<std::uint8_t> bytes(sizeof value);
        std::memcpy(bytes.data(), &value, sizeof value);
        write(urb.self, offset, bytes);
    };
    put(offsetof(usbdevfs_urb, status), status);
    put(offsetof(usbdevfs_urb, actual_length), static_cast<int>(length));
    done_.push_back(urb);
}

// Everything that is due by now.
void Kernel::live()
{
    device_.advance(std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count() - device_.now());
    while (reading_.size() > (keepsOne ? 1U : 0U)) {
        std::vector<std::uint8_t> packet;
        const int status = gone ? -ENODEV : stalled ? -EPIPE : 0;
        if (status == 0) {
            packet = device_.take();
            if (packet.empty()) {
                return;
            }
        }
        finish(reading_.back(), status, packet, packet.size());
        reading_.pop_back();
    }
}

void Kernel::control(Urb urb)
{
    const auto b = bytesOf(urb.buffer);
    const bool known = b[0] == 0x40 && device_.control(b[1], static_cast<std::uint16_t>(b[2] | b[3] << 8));
    finish(urb, known ? 0 : -EPIPE, {}, 0);
}

void Kernel::submit(UMockdevIoctlClient* client, UMockdevIoctlData* argument)
{
    if (gone) {
        umockdev_ioctl_client_complete(client, -1, ENODEV);
        return;
    }
    Urb urb;
    const auto address = bytesOf(argument);
    std::memcpy(&urb.user, address.data(), sizeof urb.user);
    urb.self = umockdev_ioctl_data_resolve(argument, 0, sizeof(usbdevfs_urb), nullptr);
    const auto content = bytesOf(urb.self);
    std::memcpy(&urb.content, content.data(), sizeof urb.content);
    const auto length = static_cast<gsize>(urb.content.bufferLength);
    urb.buffer =
        length > 0 ? umockdev_ioctl_data_resolve(urb.self, offsetof(usbdevfs_urb, buffer), length, nullptr) : nullptr;
    if (urb.content.type == USBDEVFS_URB_TYPE_CONTROL) {
        control(urb);
    } else if ((urb.content.endpoint & 0x80) != 0) {
        reading_.push_back(urb);
    } else {
        device_.put(bytesOf(urb.buffer));
        finish(urb, 0, {}, length);
    }
    umockdev_ioctl_client_complete(client, 0, 0);
}

void Kernel::reap(UMockdevIoctlClient* client, UMockdevIoctlData* argument)
{
    if (done_.empty()) {
        umockdev_ioctl_client_complete(client, -1, gone ? ENODEV : EAGAIN);
        return;
    }
    UMockdevIoctlData* place = umockdev_ioctl_data_resolve(argument, 0, sizeof(void*), nullptr);
    umockdev_ioctl_data_set_ptr(place, 0, done_.front().self);
    done_.pop_front();
    umockdev_ioctl_client_complete(client, 0, 0);
}

void Kernel::discard(UMockdevIoctlClient* client, UMockdevIoctlData* argument)
{
    gulong user = 0;
    const auto address = bytesOf(argument);
    std::memcpy(&user, address.data(), sizeof user);
    const auto found = std::ranges::find(reading_, user, &Urb::user);
    if (found == reading_.end()) {
        umockdev_ioctl_client_complete(client, -1, EINVAL);
        return;
    }
    if (!keepsOne || found != reading_.begin()) {
        finish(*found, -ENOENT, {}, 0);
        reading_.erase(found);
    }
    umockdev_ioctl_client_complete(client, 0, 0);
}

gboolean Kernel::onIoctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self)
{
    const std::lock_guard lock(asking);
    if (alive == self) {
        static_cast<Kernel*>(self)->answer(client);
    } else {
        umockdev_ioctl_client_complete(client, -1, ENODEV);
    }
    return TRUE;
}

void Kernel::answer(UMockdevIoctlClient* client)
{
    live();
    UMockdevIoctlData* argument = umockdev_ioctl_client_get_arg(client);
    const gulong request = umockdev_ioctl_client_get_request(client);
    const auto is = [request](gulong other) { return (request & 0xFFU) == (other & 0xFFU); };
    if (is(USBDEVFS_SUBMITURB)) {
        submit(client, argument);
    } else if (is(USBDEVFS_REAPURBNDELAY)) {
        reap(client, argument);
    } else if (is(USBDEVFS_DISCARDURB)) {
        discard(client, argument);
    } else if (is(USBDEVFS_GET_CAPABILITIES)) {
        constexpr std::uint8_t capabilities = USBDEVFS_CAP_BULK_CONTINUATION | USBDEVFS_CAP_NO_PACKET_SIZE_LIM;
        write(umockdev_ioctl_data_resolve(argument, 0, 4, nullptr), 0, {capabilities, 0, 0, 0});
        umockdev_ioctl_client_complete(client, 0, 0);
    } else if (is(USBDEVFS_GETDRIVER) || is(USBDEVFS_IOCTL)) {
        umockdev_ioctl_client_complete(client, -1, ENODATA);
    } else if (is(USBDEVFS_CLAIMINTERFACE) || is(USBDEVFS_DISCONNECT_CLAIM)) {
        const bool refused = refuseClaim || (owner_ != nullptr && owner_ != client);
        owner_ = refused ? owner_ : client;
        claimed = owner_ != nullptr;
        umockdev_ioctl_client_complete(client, refused ? -1 : 0, refused ? EBUSY : 0);
    } else {
        if (is(USBDEVFS_RELEASEINTERFACE) && owner_ == client) {
            owner_ = nullptr;
            reading_.clear();  // ended when the file is closed, which comes next
        }
        claimed = owner_ != nullptr;
        stalled = stalled && !is(USBDEVFS_CLEAR_HALT);
        umockdev_ioctl_client_complete(client, 0, 0);
    }
}

}  // namespace palpate::falcon
