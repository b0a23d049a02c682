#include <volume/import/barrier.h>

#include <base/quiet_child.h>
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
    void bytes(const void* data, std::size_t count) const
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
    }
    template <typename T>
    requires std::is_trivially_copyable_v<T>
    void put(const T& value) const { bytes(&value, sizeof value); }
    template <typename T>
    requires std::is_trivially_copyable_v<T>
    void put(const std::vector<T>& values) const
    {
        put(values.size());
        bytes(values.data(), values.size() * sizeof(T));
    }
    void put(const std::string& text) const
    {
        put(text.size());
        bytes(text.data(), text.size());
    }
    void put(const std::vector<std::string>& texts) const
    {
        put(texts.size());
        for (const std::string& text : texts) {
            put(text);
        }
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
    Receiver(const Receiver&) = delete;
    Receiver& operator=(const Receiver&) = delete;

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
    template <typename T>
    requires std::is_trivially_copyable_v<T>
    bool take(T& value) const { return bytes(&value, sizeof value); }
    template <typename T>
    requires std::is_trivially_copyable_v<T>
    bool take(std::vector<T>& values) const
    {
        std::size_t count = 0;
        if (!take(count)) {
            return false;
        }
        values.resize(count);
        return bytes(values.data(), count * sizeof(T));
    }
    bool take(std::string& text) const
    {
        std::size_t count = 0;
        if (!take(count)) {
            return false;
        }
        text.resize(count);
        return bytes(text.data(), count);
    }
    bool take(std::vector<std::string>& texts) const
    {
        std::size_t count = 0;
        bool whole = take(count);
        for (std::size_t i = 0; whole && i < count; ++i) {
            whole = take(texts.emplace_back());
        }
        return whole;
    }

private:
    pid_t child_;
    int from_;
};

void send(const Sender& to, const ImportedLabels& labels)
{
    to.put(labels.image.size);
    to.put(labels.image.affine);
    to.put(labels.image.values);
    to.put(labels.names.size());
    for (const LabelName& n : labels.names) {
        to.put(n.value);
        to.put(n.name);
        to.put(n.tissue);
        to.put(n.colour.has_value());
        to.put(n.colour.value_or(std::array<std::uint8_t, 3>{}));
        to.put(n.terminology);
    }
    to.put(labels.overlaps);
    to.put(labels.warnings);
    to.put(labels.renumbered);
}

bool receive(const Receiver& from, ImportedLabels& labels)
{
    std::size_t names = 0;
    bool whole = from.take(labels.image.size) && from.take(labels.image.affine) && from.take(labels.image.values) &&
                 from.take(names);
    for (std::size_t i = 0; whole && i < names; ++i) {
        LabelName& n = labels.names.emplace_back();
        bool coloured = false;
        std::array<std::uint8_t, 3> colour{};
        whole = from.take(n.value) && from.take(n.name) && from.take(n.tissue) && from.take(coloured) &&
                from.take(colour) && from.take(n.terminology);
        if (coloured) {
            n.colour = colour;
        }
    }
    return whole && from.take(labels.overlaps) && from.take(labels.warnings) && from.take(labels.renumbered);
}

void send(const Sender& to, const ImportedImage& image)
{
    to.put(image.size);
    to.put(image.affine);
    to.put(image.values);
    to.put(image.what);
    to.put(image.warnings);
}

bool receive(const Receiver& from, ImportedImage& image)
{
    return from.take(image.size) && from.take(image.affine) && from.take(image.values) && from.take(image.what) &&
           from.take(image.warnings);
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
    if (options.progress) {
        options.progress = [&to](double fraction) {
            to.put(Message::progress);
            to.put(fraction);
        };
    }
    try {
        const Result result = read(options);
        to.put(Message::result);
        send(to, result);
    } catch (const std::bad_alloc&) {
        to.put(Message::refusal);
        to.put(path.string() + ": needs more memory than there is: crop or resample it first");
    } catch (const std::runtime_error& e) {
        to.put(Message::refusal);
        to.put(std::string(e.what()));
    } catch (const std::exception& e) {
        to.put(Message::fault);
        to.put(std::string(e.what()));
    }
    ::_exit(0);
}

[[noreturn]] void died(const std::filesystem::path& path, const char* library, int status)
{
    if (!WIFSIGNALED(status)) {
        throw std::logic_error(fmt::format("{}: {} ended with status {} while it read the file", path.string(), library,
                                           WIFEXITED(status) ? WEXITSTATUS(status) : -1));
    }
    if (WTERMSIG(status) == SIGKILL) {
        refuse(path, "reading was ended by the system, which mostly means that memory ran out: crop or resample it first");
    }
    refuse(path,
           fmt::format("{} broke down on it ({}): it is damaged, get it again", library, ::strsignal(WTERMSIG(status))));
}

template <typename Result, typename Read>
Result apart(const std::filesystem::path& path, const char* library, const ImportOptions& options, const Read& read)
{
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) {
        refuse(path, fmt::format("no pipe for reading it can be made ({}): try again", std::strerror(errno)));
    }
    const pid_t child = ::fork();
    if (child == 0) {
        ::close(ends[0]);
        becomeQuiet();
        readAndSend<Result>(Sender(ends[1]), path, options, read);
    }
    ::close(ends[1]);
    Receiver from(child, ends[0]);
    if (child < 0) {
        refuse(path, fmt::format("no process for reading it can be started ({}): try again", std::strerror(errno)));
    }
    ::fcntl(ends[0], F_SETPIPE_SZ, 1 << 20);
    Message said{};
    while (from.take(said)) {
        double fraction = 0;
        Result result;
        std::string reason;
        if (said == Message::progress && from.take(fraction)) {
            options.progress(fraction);
        } else if (said == Message::result && receive(from, result)) {
            from.ended();
            return result;
        } else if (said == Message::refusal && from.take(reason)) {
            throw std::runtime_error(reason);
        } else if (said == Message::fault && from.take(reason)) {
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
