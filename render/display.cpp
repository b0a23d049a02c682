#include <render/display.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <base/error.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/random.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <thread>
#include <utility>

namespace palpate::render {
namespace {

// One record of an Xauthority file (Xau(3)): family "any", no address, no number, name, a random key.
base::Descriptor secretCookie()
{
    const std::string name = "MIT-MAGIC-COOKIE-1";
    std::array<char, 16> key{};
    if (::getrandom(key.data(), key.size(), 0) != static_cast<ssize_t>(key.size()))
        return base::Descriptor();
    std::string record("\xff\xff\0\0\0\0\0", 7);
    record += static_cast<char>(name.size());
    record += name;
    record += '\0';
    record += static_cast<char>(key.size());
    record.append(key.data(), key.size());
    base::Descriptor file(::memfd_create("palpate-xauthority", MFD_CLOEXEC));
    const bool written = ::write(*file, record.data(), record.size()) == static_cast<ssize_t>(record.size());
    return written ? std::move(file) : base::Descriptor();
}

// In the child: becomes the server, or ends with the status that a shell gives for a program that is not there.
[[noreturn]] void becomeServer(pid_t parent, int answer, const std::string& cookieFile)
{
    constexpr int notFound = 127;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent)
        ::_exit(1);
    ::setpgid(0, 0);  // Ctrl-C is for who draws on it
    const int nothing = ::open("/dev/null", O_RDWR);
    for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
        ::dup2(nothing, stream);
    const std::string number = std::to_string(answer);
    ::execlp("Xvfb", "Xvfb", "-displayfd", number.c_str(), "-auth", cookieFile.c_str(), "-screen", "0", "1280x1024x24",
             "-nolisten", "tcp", "-noreset", static_cast<char*>(nullptr));
    ::_exit(notFound);
}

// What the server writes when it is ready: its number and a newline. Empty when it has ended or takes too long.
std::string readNumber(int from)
{
    constexpr int patience = 20000;  // [ms]
    std::string number;
    pollfd waiting{from, POLLIN, 0};
    char c = 0;
    while (::poll(&waiting, 1, patience) > 0 && ::read(from, &c, 1) == 1) {
        if (c == '\n')
            return number;
        number += c;
    }
    return {};
}

}  // namespace

std::string noDisplay()
{
    const char* const display = std::getenv("DISPLAY");
    return display == nullptr || *display == '\0'
               ? "no display: set DISPLAY"
               : fmt::format("DISPLAY {} does not answer: set it to one that does", display);
}

bool displayWorks()
{
    return std::getenv("DISPLAY") != nullptr && glfwInit() == GLFW_TRUE;
}

// Starts a server. Its number is empty when it did not come up; then `status` is that which it ended with, and its process
// is gone.
std::string PrivateDisplay::start(const std::string& cookieFile, int& status)
{
    std::array<int, 2> answer{};
    base::failIf(::pipe(answer.data()) != 0, "cannot start a display: out of file descriptors");
    const pid_t parent = ::getpid();
    server_ = ::fork();
    if (server_ == 0) {
        ::close(answer[0]);
        becomeServer(parent, answer[1], cookieFile);
    }
    ::close(answer[1]);
    std::string number = server_ > 0 ? readNumber(answer[0]) : std::string();
    ::close(answer[0]);
    if (number.empty() && server_ > 0) {
        ::kill(server_, SIGKILL);
        ::waitpid(server_, &status, 0);
    }
    return number;
}

PrivateDisplay::PrivateDisplay() : cookie_(secretCookie())
{
    base::failIf(!cookie_, "cannot start a display: out of file descriptors");
    const std::string cookieFile = "/proc/" + std::to_string(::getpid()) + "/fd/" + std::to_string(*cookie_);
    // Two servers that start at the same moment may take the same number, and one of them ends: it looks again.
    constexpr int attempts = 4;
    int status = 0;
    std::string number;
    for (int i = 0; i < attempts && number.empty() && (i == 0 || (WIFEXITED(status) && WEXITSTATUS(status) != 127)); ++i)
        number = start(cookieFile, status);
    const bool missing = WIFEXITED(status) && WEXITSTATUS(status) == 127;
    base::failIf(number.empty() && missing, "no display: set DISPLAY, or install the package xvfb for --offscreen");
    base::failIf(number.empty(), "no display: DISPLAY is not set and Xvfb could not be started");
    ::setenv("DISPLAY", (":" + number).c_str(), 1);
    ::setenv("XAUTHORITY", cookieFile.c_str(), 1);
}

PrivateDisplay::~PrivateDisplay()
{
    // A server that is asked just before it waits for its clients hears of it with the next event, or after ten minutes.
    using namespace std::chrono_literals;
    bool ended = false;
    for (int i = 0; i < 100 && !ended; ++i) {
        ::kill(server_, SIGTERM);
        std::this_thread::sleep_for(20ms);
        ended = ::waitpid(server_, nullptr, WNOHANG) == server_;
    }
    if (!ended) {
        ::kill(server_, SIGKILL);
        ::waitpid(server_, nullptr, 0);
    }
}

}  // namespace palpate::render
