#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

namespace palpate::command {

/// One line on a terminal (standard error) that says what is going on, once that takes over a second; nothing elsewhere.
class Progress {
public:
    enum class Clock { still, ticking };

    /// @param clock  ticking: the line goes on counting seconds, from a thread, while nothing new is said
    explicit Progress(Clock clock = Clock::still);
    ~Progress();

    void show(const std::string& what);
    /// With a bar; `fraction` is what is done, 0 to 1.
    void show(const std::string& what, double fraction);
    /// Takes the line away, so that something else can be printed.
    void clear();

private:
    using Time = std::chrono::steady_clock;

    void draw();
    void tick(std::stop_token stop);

    Time::time_point start_ = Time::now();
    bool terminal_;
    std::mutex mutex_;  // of all below
    std::condition_variable_any wake_;
    std::string what_;
    Time::time_point drawn_;
    bool shown_ = false;
    std::jthread clock_;
};

}  // namespace palpate::command
