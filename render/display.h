#pragma once

#include <base/descriptor.h>

#include <sys/types.h>

#include <string>

namespace palpate::render {

/// Why there is none, and what to do: the environment names no display, or one that does not answer.
std::string noDisplay();

/// True when the display that the environment names can be opened. It stays open: a server that ends or begins anew with
/// its last client would be gone before the window comes.
bool displayWorks();

/// A display without a screen (Xvfb) for pictures that go to files; it ends with this process, however that ends. Only its
/// user can connect to it.
class PrivateDisplay {
public:
    /// Starts it and points DISPLAY and XAUTHORITY at it. Throws std::runtime_error where Xvfb is not installed or fails.
    PrivateDisplay();
    PrivateDisplay& operator=(PrivateDisplay&&) = delete;
    ~PrivateDisplay();

private:
    std::string start(const std::string& cookieFile, int& status);

    pid_t server_ = 0;
    base::Descriptor cookie_;
};

}  // namespace palpate::render
