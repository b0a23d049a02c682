#include <base/error.h>
#include <base/shell_word.h>
#include <haptics/record_bounds.h>
#include <haptics/record_file.h>
#include <haptics/record_format.h>
#include <haptics/record_sync.h>
#include <haptics/record_writer.h>
#include <haptics/recorder.h>

#include <boost/lockfree/spsc_queue.hpp>

#include <pthread.h>
#include <signal.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <thread>

namespace palpate::haptics {

using format::Database;
using format::FileId;
using format::fileId;
using format::makeFile;
using format::refuse;
using format::removeFile;
using format::Results;
using format::Writer;

namespace {

constexpr std::chrono::milliseconds commitPeriod{100};
constexpr int lockedWait = 100;  // between two looks at a file that another program has locked [ms]
constexpr std::chrono::seconds shortLock{2}, longestLock{10};
constexpr std::size_t ticksPerTransaction = 4096;  // bounds the write-ahead log

using Clock = std::chrono::steady_clock;

// The writer thread takes no signals; one about the size of files (RLIMIT_FSIZE) would end the process.
class SignalsBlocked {
public:
    SignalsBlocked()
    {
        sigset_t all;
        sigfillset(&all);
        pthread_sigmask(SIG_SETMASK, &all, &before_);
    }
    ~SignalsBlocked() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
    SignalsBlocked& operator=(SignalsBlocked&&) = delete;

private:
    sigset_t before_{};
};

}  // namespace

std::string SessionInfo::extraOf(std::string_view key) const
{
    const auto found = std::ranges::find(extra, key, &std::pair<std::string, std::string>::first);
    return found == extra.end() ? std::string() : found->second;
}

struct Recorder::Impl {
    std::string file;
    SessionInfo info;
    std::filesystem::path place;  // absolute: the working directory may change
    FileId written;               // the file that was made there
    boost::lockfree::spsc_queue<TickRecord> ring;
    std::atomic<std::uint64_t> lost{0};
    std::optional<Database> database;
    std::optional<Writer> writer;
    std::uint64_t syncEvery, unsynced = 0;  // ticks
    std::optional<format::LogSync> sync;    // of the log

    mutable std::mutex mutex;  // guards what follows; the servo thread never takes it
    std::condition_variable wake, served;
    std::uint64_t requests = 0, answered = 0;
    bool stopping = false;
    std::optional<Results> results;
    std::string error;
    std::string unfolded;  // why the log of a whole record is still there; empty: it is not, or a reader keeps it
    std::thread thread;
    // Of that thread:
    bool closed = false;                           // all that was written is sealed
    std::optional<Clock::time_point> lockedSince;  // by another program

    // The ring holds eight seconds at the session's rate, and never less than eight at 1 kHz.
    Impl(const std::string& path, const SessionInfo& of)
        : file(path),
          info(of),
          ring(static_cast<std::size_t>(std::clamp(8 * info.rate, 8192.0, 65536.0))),
          syncEvery(static_cast<std::uint64_t>(5 * info.rate))
    {
        // Touches every page of the ring now and not in the servo loop.
        while (ring.push(TickRecord{})) {
        }
        ring.reset();
        std::vector<format::SealedPart> begun = makeFile(file, info);
        place = std::filesystem::absolute(file);
        written = fileId(place);
        try {
            database.emplace(place.string(), SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX);
            // A killed process loses nothing that was committed, so no commit has to wait for the disk. NORMAL syncs when a
            // log is begun, which is done before the session, and when it is folded into the file, which then is
            // left to the end: a sync may take a second on a busy disk. In between, LogSync does it beside this thread.
            database->execute("PRAGMA synchronous = NORMAL; PRAGMA wal_autocheckpoint = 0");
            database->execute("PRAGMA user_version = " + std::to_string(format::version));  // as it is: begins the log
            sqlite3_busy_timeout(database->get(), lockedWait);
            writer.emplace(*database, format::columnsOf(info), std::move(begun));
            const SignalsBlocked inherited;
            sync.emplace(place.string() + "-wal");
            thread = std::thread([this] { work(); });
        } catch (const std::exception& e) {
            removeFile(file);
            refuse(file, e.what());
        }
    }

    void work() noexcept
    {
        pthread_setname_np(pthread_self(), "palpate-record");
        std::unique_lock lock(mutex);
        for (bool last = false; !last;) {
            wake.wait_for(lock, commitPeriod, [&] { return stopping || requests > answered; });
            const std::uint64_t request = requests;
            const std::optional<Results> toFinish = std::exchange(results, std::nullopt);
            last = stopping;
            const bool awaited = last || request > answered;
            const bool failed = !error.empty();
            lock.unlock();
            std::string problem = failed ? drop() : store(toFinish, last, awaited);
            std::string apart = toFinish && closed ? fold() : std::string();
            lock.lock();
            if (!problem.empty()) {
                error = file + ": recording stopped: " + problem + "; what was written until then can be read";
            }
            if (toFinish) {
                unfolded = std::move(apart);
            }
            answered = request;
            served.notify_all();
        }
    }

    // After an error the session goes on without a record: one with a hole could not be replayed.
    std::string drop() noexcept
    {
        lost += ring.consume_all([](const TickRecord&) {});
        return {};
    }

    // Begins to write. False while another program has the file locked: ticks then wait in the ring, until that is nearly
    // full. Where somebody waits for the file, it is tried for ten seconds.
    bool begin(bool awaited)
    {
        for (const auto first = Clock::now();;) {
            const int kind = sqlite3_exec(database->get(), "BEGIN IMMEDIATE", nullptr, nullptr, nullptr) & 0xFF;
            if (kind == SQLITE_OK) {
                lockedSince.reset();
                return true;
            }
            const auto now = Clock::now();
            lockedSince = lockedSince.value_or(first);
            const bool nearlyFull = ring.write_available() < (ring.write_available() + ring.read_available()) / 16;
            const bool enough = awaited ? now - first > longestLock : nearlyFull && now - *lockedSince > shortLock;
            base::failIf((kind != SQLITE_BUSY && kind != SQLITE_LOCKED) || enough, "{}", sqlite3_errmsg(database->get()));
            if (!awaited) {
                return false;
            }
        }
    }

    // Every five seconds, so that a power cut takes no more than that.
    void syncAfter(std::size_t ticks)
    {
        unsynced += ticks;
        if (unsynced >= syncEvery) {
            sync->begin();
            unsynced = 0;
        }
    }

    // Empty, or why no Record would hand this tick out.
    std::string whyUnreadable(const TickRecord& tick) const
    {
        try {
            format::checkTick(tick, info);
            return {};
        } catch (const std::runtime_error& e) {
            return e.what();
        }
    }

    // Writes the next tick. False where there is none, or where it is unreadable.
    bool writeNext(std::string& unreadable)
    {
        bool written = false;
        ring.consume_one([&](const TickRecord& tick) {
            unreadable = whyUnreadable(tick);
            if (unreadable.empty()) {
                writer->write(tick);
                written = true;
            }
        });
        return written;
    }

    // Returns what went wrong, or nothing.
    std::string store(const std::optional<Results>& toFinish, bool last, bool awaited) noexcept
    {
        std::size_t taken = 0;
        try {
            do {
                taken = 0;
                if (ring.read_available() == 0) {
                    break;
                }
                closed = false;
                if (!begin(awaited)) {
                    return {};
                }
                std::string unreadable;
                while (taken < ticksPerTransaction && writeNext(unreadable)) {
                    ++taken;
                }
                database->execute("COMMIT");
                if (!unreadable.empty()) {
                    taken = 0;
                    ++lost;
                    throw std::runtime_error(unreadable);
                }
                syncAfter(taken);
            } while (taken == ticksPerTransaction);
            taken = 0;
            if (toFinish || (last && !closed)) {
                complete(toFinish.value_or(Results{}));
                closed = true;
            }
            return {};
        } catch (const std::exception& e) {
            std::string why = e.what();
            sqlite3_exec(database->get(), "ROLLBACK", nullptr, nullptr, nullptr);
            lost += taken;
            drop();
            return why;
        }
    }

    void complete(const Results& values)
    {
        begin(true);
        writer->close(lost.load(), values);
        database->execute("COMMIT");
    }

    // Folds the log into the file, so that one plain file is left. With a reader still there the log stays, which is as
    // good: the reader leaves the file all that it needs. Returns what is to be done where there is no room for it.
    std::string fold() noexcept
    {
        sqlite3_busy_timeout(database->get(), 2000);  // a reader may be at work just now
        int status = sqlite3_wal_checkpoint_v2(database->get(), nullptr, SQLITE_CHECKPOINT_PASSIVE, nullptr, nullptr);
        if (status == SQLITE_OK) {
            status = sqlite3_exec(database->get(), "PRAGMA journal_mode = DELETE", nullptr, nullptr, nullptr);
        }
        const int kind = status & 0xFF;  // without what SQLite says in addition
        if (kind == SQLITE_OK || kind == SQLITE_BUSY || kind == SQLITE_LOCKED) {
            return {};
        }
        const std::string why = sqlite3_errmsg(database->get());
        return file + ": is whole only together with " + file + "-wal: " + why + "; make room, then sqlite3 " +
               base::shellWord(place.string()) + " 'PRAGMA journal_mode = DELETE' makes one file of both";
    }

    // Writing to a file that has lost its name succeeds, and nobody finds it.
    void checkPlace()
    {
        const std::scoped_lock lock(mutex);
        if (error.empty() && fileId(place) != written) {
            error = file + ": was removed or moved while it was written: its session is not there";
        }
    }

    void request(std::optional<Results> values)
    {
        std::unique_lock lock(mutex);
        if (values) {
            results = std::move(values);
        }
        const std::uint64_t mine = ++requests;
        wake.notify_all();
        served.wait(lock, [&] { return answered >= mine; });
    }

    ~Impl()
    {
        {
            const std::scoped_lock lock(mutex);
            stopping = true;
        }
        wake.notify_all();
        thread.join();
        const SignalsBlocked closing;
        writer.reset();
        if (error.empty()) {
            fold();  // what a reader kept until now
        }
        database.reset();
        const timespec now{};
        sigset_t tooBig;
        sigemptyset(&tooBig);
        sigaddset(&tooBig, SIGXFSZ);
        sigtimedwait(&tooBig, nullptr, &now);
    }
};

Recorder::Recorder(const std::filesystem::path& file, const SessionInfo& info)
{
    try {
        format::checkInfo(info);
    } catch (const std::runtime_error& e) {
        refuse(file.string(), e.what());
    }
    impl_ = std::make_unique<Impl>(file.string(), info);
}

Recorder::~Recorder() = default;

void Recorder::push(const TickRecord& record) noexcept
{
    if (!impl_->ring.push(record)) {
        impl_->lost.fetch_add(1, std::memory_order_relaxed);
    }
}

void Recorder::flush()
{
    impl_->request(std::nullopt);
}

void Recorder::finish(const Results& results)
{
    impl_->request(results);
    impl_->checkPlace();
}

std::uint64_t Recorder::lost() const noexcept
{
    return impl_->lost.load(std::memory_order_relaxed);
}

std::string Recorder::error() const
{
    const std::scoped_lock lock(impl_->mutex);
    return impl_->error.empty() ? impl_->unfolded : impl_->error;
}

bool Recorder::whole() const
{
    const std::scoped_lock lock(impl_->mutex);
    return impl_->error.empty() && lost() == 0;
}

}  // namespace palpate::haptics
