// An emulated Novint Falcon that a virtual machine sees on its USB: QEMU's usb-redir connects to it. See docs/devices.md.
#include <base/inputs.h>
#include <tests/falcon/emulator.h>

#include <base/error.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
#include <usbredirparser.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <iterator>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace {

using namespace palpate;
using namespace palpate::falcon;
using Clock = std::chrono::steady_clock;

constexpr std::array<std::uint8_t, 18> deviceDescriptor{18, 1, 0, 2, 0, 0, 0, 8, 0x03, 0x04, 0x48, 0xCB, 0, 4, 1, 2, 3, 1};
constexpr std::array<std::uint8_t, 32> configuration{9,    2, 32, 0, 1,    1, 0,  0x80, 45, 9, 4, 0,    0, 2,  0xFF, 0xFF,
                                                     0xFF, 0, 7,  5, 0x81, 2, 64, 0,    0,  7, 5, 0x02, 2, 64, 0,    0};
constexpr std::array<std::string_view, 4> strings{"", "Palpate (emulated)", "FALCON HAPTIC", "EMU0001"};

// Standard requests of USB, by bmRequestType and bRequest.
constexpr int getDescriptor = 0x8006, getStatus = 0x8000, clearFeature = 0x0201;
constexpr int toVendor = 0x40, fromVendor = 0xC0;
constexpr int modemStatus = 5, latencyTimer = 10;

using Packets = std::vector<std::uint8_t>;

std::optional<Packets> descriptor(int type, std::size_t index)
{
    if (type == 1) {
        return Packets(deviceDescriptor.begin(), deviceDescriptor.end());
    }
    if (type == 2) {
        return Packets(configuration.begin(), configuration.end());
    }
    if (type == 3 && index == 0) {
        return Packets{4, 3, 9, 4};
    }
    if (type == 3 && index < strings.size()) {
        Packets text{0, 3};
        for (const char c : strings[index]) {
            text.push_back(static_cast<std::uint8_t>(c));
            text.push_back(0);
        }
        text[0] = static_cast<std::uint8_t>(text.size());
        return text;
    }
    return std::nullopt;
}

// The device's end of the usbredir protocol.
class Server {
public:
    Server(Emulator& device, int socket);
    ~Server() { usbredirparser_destroy(parser_); }
    Server(const Server&) = delete;
    Server& operator=(const Server&) = delete;

    void plug();
    void unplug();
    /// Reads and writes what is due; false at the end of the connection.
    bool serve();
    /// Answers the reads that wait.
    void answerReads();
    bool waiting() const { return !reads_.empty(); }

private:
    struct Read {
        std::uint64_t id = 0;
        usb_redir_bulk_packet_header header{};
    };

    void describe();
    void setCallbacks();
    void control(std::uint64_t id, usb_redir_control_packet_header header);
    void bulk(std::uint64_t id, usb_redir_bulk_packet_header header, std::uint8_t* data, int length);
    void cancel(std::uint64_t id);
    void finish(const Read& read, int status, Packets data);
    static Server& of(void* self) { return *static_cast<Server*>(self); }

    Emulator& device_;
    int socket_;
    bool plugged_ = true;
    bool broken_ = false;
    usbredirparser* parser_;
    std::deque<Read> reads_;
};

Server::Server(Emulator& device, int socket) : device_(device), socket_(socket), parser_(usbredirparser_create())
{
    setCallbacks();
    std::array<std::uint32_t, USB_REDIR_CAPS_SIZE> caps{};
    for (const int cap :
         {usb_redir_cap_connect_device_version, usb_redir_cap_filter, usb_redir_cap_device_disconnect_ack,
          usb_redir_cap_ep_info_max_packet_size, usb_redir_cap_64bits_ids, usb_redir_cap_32bits_bulk_length}) {
        usbredirparser_caps_set_cap(caps.data(), cap);
    }
    usbredirparser_init(parser_, "palpate-falcon-emulator", caps.data(), USB_REDIR_CAPS_SIZE, usbredirparser_fl_usb_host);
}

void Server::setCallbacks()
{
    usbredirparser& p = *parser_;
    p.priv = this;
    p.log_func = [](void*, int level, const char* message) {
        if (level <= usbredirparser_warning) {
            fmt::print(stderr, "falcon-emulator: {}\n", message);
        }
    };
    p.read_func = [](void* self, std::uint8_t* data, int count) {
        const ssize_t n = recv(of(self).socket_, data, static_cast<std::size_t>(count), MSG_DONTWAIT);
        const bool later = n < 0 && (errno == EAGAIN || errno == EINTR);
        of(self).broken_ = of(self).broken_ || n == 0;
        return later ? 0 : n <= 0 ? -1 : static_cast<int>(n);
    };
    p.write_func = [](void* self, std::uint8_t* data, int count) {
        const ssize_t n = ::send(of(self).socket_, data, static_cast<std::size_t>(count), MSG_NOSIGNAL);
        return n >= 0 ? static_cast<int>(n) : errno == EAGAIN ? 0 : -1;
    };
    p.hello_func = [](void* self, usb_redir_hello_header*) {
        if (of(self).plugged_) {
            of(self).plug();
        }
    };
    p.reset_func = [](void* self) { of(self).reads_.clear(); };
    p.set_configuration_func = [](void* self, std::uint64_t id, usb_redir_set_configuration_header* h) {
        of(self).describe();
        usb_redir_configuration_status_header status{usb_redir_success, h->configuration};
        usbredirparser_send_configuration_status(of(self).parser_, id, &status);
    };
    p.get_configuration_func = [](void* self, std::uint64_t id) {
        usb_redir_configuration_status_header status{usb_redir_success, 1};
        usbredirparser_send_configuration_status(of(self).parser_, id, &status);
    };
    p.set_alt_setting_func = [](void* self, std::uint64_t id, usb_redir_set_alt_setting_header* h) {
        usb_redir_alt_setting_status_header status{usb_redir_success, h->interface, h->alt};
        usbredirparser_send_alt_setting_status(of(self).parser_, id, &status);
    };
    p.get_alt_setting_func = [](void* self, std::uint64_t id, usb_redir_get_alt_setting_header* h) {
        usb_redir_alt_setting_status_header status{usb_redir_success, h->interface, 0};
        usbredirparser_send_alt_setting_status(of(self).parser_, id, &status);
    };
    p.control_packet_func = [](void* self, std::uint64_t id, usb_redir_control_packet_header* h, std::uint8_t* data, int) {
        of(self).control(id, *h);
        usbredirparser_free_packet_data(of(self).parser_, data);
    };
    p.bulk_packet_func = [](void* self, std::uint64_t id, usb_redir_bulk_packet_header* h, std::uint8_t* data, int length) {
        of(self).bulk(id, *h, data, length);
        usbredirparser_free_packet_data(of(self).parser_, data);
    };
    p.cancel_data_packet_func = [](void* self, std::uint64_t id) { of(self).cancel(id); };
    p.filter_reject_func = [](void*) {};
    p.filter_filter_func = [](void*, usbredirfilter_rule* rules, int) { std::free(rules); };
    p.device_disconnect_ack_func = [](void*) {};
    p.start_interrupt_receiving_func = [](void*, std::uint64_t, usb_redir_start_interrupt_receiving_header*) {};
}

void Server::describe()
{
    usb_redir_interface_info_header interfaces{};
    interfaces.interface_count = 1;
    interfaces.interface_class[0] = interfaces.interface_subclass[0] = interfaces.interface_protocol[0] = 0xFF;
    usbredirparser_send_interface_info(parser_, &interfaces);
    // Endpoints out are 0 to 15, endpoints in are 16 to 31.
    usb_redir_ep_info_header endpoints{};
    for (auto& type : endpoints.type) {
        type = usb_redir_type_invalid;
    }
    endpoints.type[0] = endpoints.type[16] = usb_redir_type_control;
    endpoints.max_packet_size[0] = endpoints.max_packet_size[16] = 8;
    endpoints.type[endpointOut] = endpoints.type[16 + (endpointIn & 0x0F)] = usb_redir_type_bulk;
    endpoints.max_packet_size[endpointOut] = endpoints.max_packet_size[16 + (endpointIn & 0x0F)] = usbPacket;
    usbredirparser_send_ep_info(parser_, &endpoints);
}

void Server::plug()
{
    plugged_ = true;
    describe();
    usb_redir_device_connect_header header{};
    header.speed = usb_redir_speed_full;
    header.vendor_id = vendorId;
    header.product_id = productId;
    header.device_version_bcd = 0x0400;
    usbredirparser_send_device_connect(parser_, &header);
}

void Server::unplug()
{
    plugged_ = false;
    reads_.clear();
    usbredirparser_send_device_disconnect(parser_);
}

bool Server::serve()
{
    if (usbredirparser_do_read(parser_) == usbredirparser_read_io_error || broken_) {
        return false;
    }
    answerReads();
    while (usbredirparser_has_data_to_write(parser_) > 0) {
        if (usbredirparser_do_write(parser_) < 0) {
            return false;
        }
    }
    return true;
}

void Server::control(std::uint64_t id, usb_redir_control_packet_header header)
{
    Packets data;
    bool known = true;
    const int request = header.requesttype << 8 | header.request;
    if (request == getDescriptor) {
        const auto found = descriptor(header.value >> 8, header.value & 0xFFU);
        known = found.has_value();
        data = found.value_or(Packets{});
    } else if (request == getStatus) {
        data = {0, 0};
    } else if (header.requesttype == toVendor) {
        known = device_.control(header.request, header.value);
    } else if (header.requesttype == fromVendor && header.request == modemStatus) {
        data = {0x01, 0x60};
    } else if (header.requesttype == fromVendor && header.request == latencyTimer) {
        data = {16};
    } else {
        known = request == clearFeature;
    }
    data.resize(std::min<std::size_t>(data.size(), header.length));
    header.status = known ? usb_redir_success : usb_redir_stall;
    if ((header.requesttype & 0x80) != 0) {
        header.length = static_cast<std::uint16_t>(data.size());
    }
    usbredirparser_send_control_packet(parser_, id, &header, data.empty() ? nullptr : data.data(),
                                       static_cast<int>(data.size()));
}

void Server::finish(const Read& read, int status, Packets data)
{
    auto header = read.header;
    header.status = static_cast<std::uint8_t>(status);
    header.length = static_cast<std::uint16_t>(data.size());
    header.length_high = 0;
    usbredirparser_send_bulk_packet(parser_, read.id, &header, data.empty() ? nullptr : data.data(),
                                    static_cast<int>(data.size()));
}

void Server::bulk(std::uint64_t id, usb_redir_bulk_packet_header header, std::uint8_t* data, int length)
{
    if ((header.endpoint & 0x80) != 0) {
        reads_.push_back({id, header});
        return;
    }
    device_.put({data, static_cast<std::size_t>(length)});
    header.status = usb_redir_success;
    usbredirparser_send_bulk_packet(parser_, id, &header, nullptr, 0);
}

void Server::answerReads()
{
    while (!reads_.empty()) {
        auto packet = device_.take(reads_.front().header.length);
        if (packet.empty()) {
            return;
        }
        finish(reads_.front(), usb_redir_success, std::move(packet));
        reads_.pop_front();
    }
}

void Server::cancel(std::uint64_t id)
{
    const auto found = std::ranges::find(reads_, id, &Read::id);
    if (found != reads_.end()) {
        finish(*found, usb_redir_cancelled, {});
        reads_.erase(found);
    }
}

// What the test wants to know, in one line of JSON.
std::string stateOf(const Emulator& d, double peak)
{
    const Vec3 p = d.position(), f = d.motorForce();
    const auto& m = d.command().motor;
    return fmt::format(
        "{{\"running\": {}, \"homed\": {}, \"packets\": {}, \"position_mm\": [{:.3f}, {:.3f}, {:.3f}], "
        "\"force_n\": [{:.4f}, {:.4f}, {:.4f}], \"peak_push_n\": {:.4f}, \"motor\": [{}, {}, {}], "
        "\"lamps\": {}, \"weight_n\": {:.3f}}}",
        d.running(), d.homed() == allHomed, d.packets(), 1e3 * p.x, 1e3 * p.y, 1e3 * p.z, f.x, f.y, f.z, peak, m[0], m[1],
        m[2], d.command().lamps, d.weight());
}

// Orders from standard input, one a line; each is answered by the state.
class Orders {
public:
    Orders(Emulator& device, Server& server) : device_(device), server_(server) {}

    /// False when there will be no more.
    bool read()
    {
        std::array<char, 512> part{};
        const ssize_t n = ::read(STDIN_FILENO, part.data(), part.size());
        if (n <= 0) {
            return n < 0 && errno == EAGAIN;
        }
        text_.append(part.data(), static_cast<std::size_t>(n));
        for (auto end = text_.find('\n'); end != std::string::npos; end = text_.find('\n')) {
            carryOut(text_.substr(0, end));
            text_.erase(0, end + 1);
        }
        return true;
    }

    /// Notes the most that the motors have pushed the grip towards the user [N].
    void watch() { peak_ = std::max(peak_, device_.motorForce().z); }

private:
    void carryOut(const std::string& line)
    {
        std::istringstream words(line);
        std::string what, name;
        double x = 0.0, y = 0.0, z = 0.0, value = 0.0;
        words >> what;
        if (what == "hand" && words >> x >> y >> z) {
            device_.hand.goal = 1e-3 * Vec3(x, y, z);
            if (words >> value) {
                device_.hand.speed = 1e-3 * value;
            }
        } else if (what == "buttons" && words >> value) {
            device_.hand.buttons = static_cast<std::uint8_t>(value);
        } else if (what == "unplug") {
            server_.unplug();
        } else if (what == "plug") {
            server_.plug();
        } else if (what == "power-cycle") {
            device_.powerCycle();
        } else if (what != "state") {
            fmt::print("{{\"error\": \"no such order\"}}\n");
            std::fflush(stdout);
            return;
        }
        fmt::print("{}\n", stateOf(device_, peak_));
        std::fflush(stdout);
    }

    Emulator& device_;
    Server& server_;
    std::string text_;
    double peak_ = 0;
};

int connectTo(const std::string& path)
{
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    for (int i = 0; i < 1000; ++i) {
        const int fd = socket(AF_UNIX, SOCK_STREAM, 0);
        if (connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0) {
            return fd;
        }
        close(fd);
        usleep(10000);
    }
    throw std::runtime_error(path + ": nobody listens there: start QEMU with -chardev socket,path=...,server=on");
}

void run(const std::string& path, const std::string& firmware)
{
    const auto program = base::contentOf(firmware);
    base::failIf(!program, "{}: cannot be read: give the firmware that the emulated Falcon runs", firmware);
    Emulator device({program->begin(), program->end()});
    const int socket = connectTo(path);
    Server server(device, socket);
    Orders orders(device, server);
    fcntl(STDIN_FILENO, F_SETFL, fcntl(STDIN_FILENO, F_GETFL) | O_NONBLOCK);
    const auto start = Clock::now();
    for (;;) {
        std::array<pollfd, 2> wait{pollfd{socket, POLLIN, 0}, pollfd{STDIN_FILENO, POLLIN, 0}};
        const timespec time{0, server.waiting() ? 200'000 : 2'000'000};
        ppoll(wait.data(), wait.size(), &time, nullptr);
        device.advance(std::chrono::duration<double>(Clock::now() - start).count() - device.now());
        orders.watch();
        if (!server.serve() || (wait[1].revents != 0 && !orders.read())) {
            break;
        }
    }
    close(socket);
}

}  // namespace

int main(int argc, char** argv)
{
    CLI::App app("An emulated Novint Falcon for QEMU's usb-redir", "falcon-emulator");
    std::string socket, firmware;
    app.add_option("--socket", socket, "Unix socket of QEMU's chardev")->required();
    app.add_option("--firmware", firmware, "Firmware that the emulated Falcon accepts")->required();
    CLI11_PARSE(app, argc, argv);
    try {
        run(socket, firmware);
        return 0;
    } catch (const std::exception& e) {
        fmt::print(stderr, "falcon-emulator: {}\n", e.what());
        return 1;
    }
}
