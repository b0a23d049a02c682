#include <haptics/record_sync.h>

#include <fcntl.h>
#include <pthread.h>
#include <unistd.h>

namespace palpate::haptics::format {

LogSync::LogSync(const std::filesystem::path& log)
    : log_(::open(log.c_str(), O_RDONLY | O_CLOEXEC)), thread_([this] { work(); })
{
}

LogSync::~LogSync()
{
    {
        const std::scoped_lock lock(mutex_);
        stopping_ = true;
    }
    wake_.notify_all();
    thread_.join();
}

void LogSync::begin()
{
    {
        const std::scoped_lock lock(mutex_);
        wanted_ = true;
    }
    wake_.notify_all();
}

void LogSync::work() noexcept
{
    pthread_setname_np(pthread_self(), "palpate-sync");
    std::unique_lock lock(mutex_);
    for (;;) {
        wake_.wait(lock, [&] { return wanted_ || stopping_; });
        if (stopping_) {
            return;
        }
        lock.unlock();
        ::fdatasync(*log_);  // a disk that fails is found when the log is folded
        lock.lock();
        wanted_ = false;
    }
}

}  // namespace palpate::haptics::format
