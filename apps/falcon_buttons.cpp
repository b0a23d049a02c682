#include <apps/falcon_buttons.h>

#include <base/end_in_order.h>
#include <command/interrupted.h>

#include <haptics/falcon/buttons.h>
#include <haptics/falcon/usb.h>

#include <fmt/format.h>

#include <time.h>
#include <unistd.h>

#include <cstdio>
#include <exception>
#include <string>

namespace palpate::apps {

namespace {

constexpr time_t betweenLooks = 1;  // for a Falcon [s]

void printLine(const std::string& line)
{
    fmt::print("{}\n", line);
    std::fflush(stdout);
}

}  // namespace

void printButtons(const session::FalconOptions& options)
{
    falcon::LinkOptions link = session::linkOptions(options);
    link.home = false;
    const base::EndInOrder untilItsEnd;
    const pid_t parent = ::getppid();  // without it nobody listens any more
    const auto ended = [parent] { return base::EndInOrder::asked() || ::getppid() != parent; };
    std::string before;
    while (!ended()) {
        std::string why = "the Falcon stopped answering, or was unplugged";
        try {
            const auto wire = falcon::usbTransport();
            falcon::Link falcon(*wire, link, [](const std::string&) {});
            falcon.connect(base::EndInOrder::asked());
            printLine("ready: the buttons of the Falcon's grip, as they are pressed");
            falcon::watchButtons(
                falcon, *wire, [](std::uint8_t button) { printLine(fmt::format("button {}", falcon::nameOf(button))); },
                ended);
            falcon.close();
            before.clear();
        } catch (const std::exception& e) {
            why = e.what();
        }
        if (why != before && !ended()) {
            printLine("waiting: " + why);
        }
        before = why;
        // A signal ends the sleep.
        timespec pause{betweenLooks, 0};
        ended() ? 0 : ::nanosleep(&pause, nullptr);
    }
    if (const int signal = base::EndInOrder::signal(); signal != 0) {
        throw command::Interrupted(signal, "interrupted");
    }
}

}  // namespace palpate::apps
