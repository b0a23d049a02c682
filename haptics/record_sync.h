#pragma once

// A record's log on the disk; for the writer (recorder.cpp), no public header.

#include <base/descriptor.h>

#include <condition_variable>
#include <filesystem>
#include <mutex>
#include <thread>

namespace palpate::haptics::format {

/// Brings what is in a log to the disk, on a thread of its own: on a busy disk that may take longer than the ring holds.
class LogSync {
public:
    explicit LogSync(const std::filesystem::path& log);
    ~LogSync();
    LogSync& operator=(LogSync&&) = delete;

    /// Begins with what was written until now. While it is still at work with what was there before, what is new has to
    /// wait until the next call.
    void begin();

private:
    void work() noexcept;

    base::Descriptor log_;
    std::mutex mutex_;
    std::condition_variable wake_;
    bool wanted_ = false, stopping_ = false;
    std::thread thread_;
};

}  // namespace palpate::haptics::format
