#include <volume/import/barrier.h>

#include <base/process.h>
#include <volume/import/source.h>

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <new>
#include <type_traits>

namespace palpate::volume {

namespace {

enum class Message : std::uint8_t { progress, result, refusal, fault };

/// The child's end of the pipe.
class Sender {
public:
    explicit Sender(int to) : to_(to) {}

    // The parent is gone or wants no more where the pipe is closed: SIGPIPE ends this process.
    bool bytes(const void* data, std::size_t count) const
    {
        const auto* at = static_cast<const char*>(data);
        while (count > 0) {
            const ssize_t written = ::write(to_, at, count);
            if (written < 0 && errno != EINTR) {
                ::_exit(1);
            }
            at += written > 0 ? written : 0;
            count -= static_cast<std::size_t>(written > 0 ? written : 0);
        }
        return true;
    }

private:
    int to_;
};

/// The parent's end, and the child itself, which does not outlive it.
class Receiver {
public:
    Receiver(pid_t child, int from) : child_(child), from_(from) {}
    ~Receiver()
    {
        ::close(from_);
        if (child_ > 0) {
            ::kill(child_, SIGKILL);
            ended();
        }
    }
    Receiver& operator=(Receiver&&) = delete;

    /// Waits for the child's end; how it was.
    int ended()
    {
        int status = 0;
        while (::waitpid(child_, &status, 0) < 0 && errno == EINTR) {
        }
        child_ = 0;
        return status;
    }
    /// False where the child has ended before it sent all of it.
    bool bytes(void* data, std::size_t count) const
    {
        auto* at = static_cast<char*>(data);
        while (count > 0) {
            const ssize_t there = ::read(from_, at, count);
            if (there == 0 || (there < 0 && errno != EINTR)) {
                return false;
            }
            at += there > 0 ? there : 0;
            count -= static_cast<std::size_t>(there > 0 ? there : 0);
        }
        return true;
    }

private:
    pid_t child_;
    int from_;
};

// Both ends pass on the same parts in the same order: the child's writes them, the parent's reads them. False where the
// child has ended before all of it came.
template <class End, typename T>
requires std::is_trivially_copyable_v<T>
bool pass(const End& end, T& value)
{
    return end.bytes(&value, sizeof value);
}

template <class End, typename List>
bool passBytes(const End& end, List& list)
{
    std::size_t count = list.size();
    if (!pass(end, count)) {
        return false;
    }
    list.resize(count);
    return end.bytes(list.data(), count * sizeof list[0]);
}

template <class End>
bool pass(const End& end, std::string& text)
{
    return passBytes(end, text);
}

template <class End>
bool pass(const End& end, LabelName& n)
{
    return pass(end, n.value) && pass(end, n.name) && pass(end, n.tissue) && pass(end, n.colour) &&
           pass(end, n.terminology);
}

template <class End, typename T>
bool pass(const End& end, std::vector<T>& list)
{
    if constexpr (std::is_trivially_copyable_v<T>) {
        return passBytes(end, list);
    }
    std::size_t count = list.size();
    bool whole = pass(end, count);
    list.resize(whole ? count : 0);
    for (T& one : list) {
        whole = whole && pass(end, one);
    }
    return whole;
}

template <class End>
bool pass(const End& end, ImportedLabels& labels)
{
    return pass(end, labels.image.size) && pass(end, labels.image.affine) && pass(end, labels.image.values) &&
           pass(end, labels.names) && pass(end, labels.overlaps) && pass(end, labels.warnings) &&
           pass(end, labels.renumbered) && pass(end, labels.frame) && pass(end, labels.madeOf);
}

template <class End>
bool pass(const End& end, ImportedImage& image)
{
    return pass(end, image.size) && pass(end, image.affine) && pass(end, image.values) && pass(end, image.what) &&
           pass(end, image.warnings) && pass(end, image.frame);
}

// A failed assertion leaves neither text nor a core behind; ours is the one line that is thrown.
void becomeQuiet()
{
    base::becomeQuietChild();
    ::signal(SIGPIPE, SIG_DFL);
}

template <typename Result, typename Read>
[[noreturn]] void readAndSend(const Sender& to, const std::filesystem::path& path, ImportOptions options, const Read& read)
{
    const auto send = [&to](Message kind, auto what) { return pass(to, kind) && pass(to, what); };
    if (options.progress) {
        options.progress = [&send](double fraction) { send(Message::progress, fraction); };
    }
    try {
        send(Message::result, read(options));
    } catch (const std::bad_alloc&) {
        send(Message::refusal, path.string() + ": needs more memory than there is: crop or resample it first");
    } catch (const std::runtime_error& e) {
        send(Message::refusal, std::string(e.what()));
    } catch (const std::exception& e) {
        send(Message::fault, std::string(e.what()));
    }
    ::_exit(0);
}

[[noreturn]] void died(const std::filesystem::path& path, const char* library, int status)
{
    if (!WIFSIGNALED(status)) {
        throw std::logic_error(fmt::format("{}: {} ended with status {} while it read the file", path.string(), library,
                                           WIFEXITED(status) ? WEXITSTATUS(status) : -1));
    }
    refuseIf(WTERMSIG(status) == SIGKILL, path,
             "reading was ended by the system, which mostly means that memory ran out: crop or resample it first");
    refuse(path, "{} broke down on it ({}): it is damaged, get it again", library, ::strsignal(WTERMSIG(status)));
}

template <typename Result, typename Read>
Result apart(const std::filesystem::path& path, const char* library, const ImportOptions& options, const Read& read)
{
    int ends[2];
    const bool none = ::pipe2(ends, O_CLOEXEC) != 0;
    refuseIf(none, path, "no pipe for reading it can be made ({}): try again", std::strerror(errno));
    const pid_t child = ::fork();
    if (child == 0) {
        ::close(ends[0]);
        becomeQuiet();
        readAndSend<Result>(Sender(ends[1]), path, options, read);
    }
    ::close(ends[1]);
    Receiver from(child, ends[0]);
    refuseIf(child < 0, path, "no process for reading it can be started ({}): try again", std::strerror(errno));
    ::fcntl(ends[0], F_SETPIPE_SZ, 1 << 20);
    Message said{};
    while (pass(from, said)) {
        double fraction = 0;
        Result result;
        std::string reason;
        if (said == Message::progress && pass(from, fraction)) {
            options.progress(fraction);
        } else if (said == Message::result && pass(from, result)) {
            from.ended();
            return result;
        } else if (said == Message::refusal && pass(from, reason)) {
            throw std::runtime_error(reason);
        } else if (said == Message::fault && pass(from, reason)) {
            throw std::logic_error(reason);
        }
    }
    died(path, library, from.ended());
}

}  // namespace

ImportedLabels labelsApart(const std::filesystem::path& path, const char* library, const ImportOptions& options,
                           const LabelReader& read)
{
    return apart<ImportedLabels>(path, library, options, read);
}

ImportedImage imageApart(const std::filesystem::path& path, const char* library, const ImportOptions& options,
                         const ImageReader& read)
{
    return apart<ImportedImage>(path, library, options, read);
}

}  // namespace palpate::volume
