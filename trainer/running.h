#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::trainer {

/// A command that runs; what it prints is kept in a file. Not part of the interface.
class Running {
public:
    /// Throws std::runtime_error where it cannot be started.
    Running(const std::filesystem::path& program, const std::vector<std::string>& arguments, std::filesystem::path log);
    /// Ends it: politely, and after five seconds otherwise.
    ~Running();
    Running& operator=(Running&&) = delete;

    /// Waits so long at most for its end [s]. Returns whether it has ended.
    bool finish(double seconds) noexcept;
    /// Breaks it off, politely.
    void end() const noexcept;
    /// Tells it that its work is done (base/end_in_order.h).
    void conclude() const noexcept;
    bool ended() noexcept;
    /// @pre  it has ended
    bool failed() const noexcept;
    /// The last line that the command printed as its own message; nothing of a command that was killed, which had no time
    /// to say why.
    std::string message() const;

private:
    std::filesystem::path log_;
    pid_t pid_ = -1;
    int status_ = 0;
};

}  // namespace palpate::trainer
