#include <base/error.h>
#include <channel/bounds.h>
#include <channel/channel.h>
#include <channel/mapping_guard.h>
#include <channel/segment.h>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <new>
#include <system_error>

namespace palpate::channel {
namespace {

struct File {
    explicit File(int opened) : descriptor(opened) {}
    File(const File&) = delete;
    File& operator=(const File&) = delete;
    ~File()
    {
        if (descriptor >= 0)
            ::close(descriptor);
    }
    int descriptor;
};

[[noreturn]] void fail(const std::string& session, const std::string& what, int error)
{
    throw base::error("session {}: {}: {}", session, what, std::strerror(error));
}

bool sameFile(int descriptor, const std::string& name)
{
    struct stat ours {
    }, named{};
    const File other(openSegment(name, O_RDONLY));
    return other.descriptor >= 0 && ::fstat(descriptor, &ours) == 0 && ::fstat(other.descriptor, &named) == 0 &&
           ours.st_ino == named.st_ino && ours.st_dev == named.st_dev;
}

struct Owner {
    bool known = false;     // the segment is one of ours, complete and laid out as here
    std::uint64_t pid = 0;  // 0: dead
};

Owner ownerOf(int descriptor)
{
    struct stat status {};
    if (::fstat(descriptor, &status) != 0 || static_cast<std::size_t>(status.st_size) < sizeof(Header))
        return {};
    void* mapped = ::mmap(nullptr, sizeof(Header), PROT_READ, MAP_SHARED, descriptor, 0);
    if (mapped == MAP_FAILED)
        return {};
    const MappingGuard guard(mapped, sizeof(Header));
    const auto& header = *static_cast<const Header*>(mapped);
    Owner owner;
    if (header.magic.load(std::memory_order_acquire) == magic) {
        owner.known = header.version == version && header.layoutHash == layoutHash();
        owner.pid = ownerLives(header) ? header.ownerPid : 0;
    }
    ::munmap(mapped, sizeof(Header));
    return owner;
}

// Removes the segment `name` that is open as `old`. The lock on it lets only one process at a time do so, and the second
// look at the name keeps a slower one from removing what a faster one has put there. Who does not get the lock leaves it to
// who has.
void removeLocked(const File& old, const std::string& name)
{
    if (::flock(old.descriptor, LOCK_EX | LOCK_NB) == 0 && sameFile(old.descriptor, name))
        ::shm_unlink(name.c_str());
}

// Removes the segment `name` if a dead process left it, or if it is not ours to understand.
void removeLeftBehind(const std::string& session, const std::string& name)
{
    const File old(openSegment(name, O_RDWR));
    if (old.descriptor < 0 && errno == ENOENT)
        return;
    if (old.descriptor < 0)
        fail(session, "there is one already that belongs to somebody else (choose another --session)", errno);
    if (const std::uint64_t pid = ownerOf(old.descriptor).pid)
        throw base::error("session {} is running already (pid {}): end it or choose another --session", session, pid);
    removeLocked(old, name);
}

// Whether `file` is the temporary name (Publisher::Impl::temporary) of a process that is dead.
bool unfinished(const std::string& file)
{
    const std::size_t dot = file.rfind('.');
    const std::string pid = dot == std::string::npos ? "" : file.substr(dot + 1);
    const bool number = !pid.empty() && pid.size() < 12 && pid.find_first_not_of("0123456789") == std::string::npos;
    return number && processStart(std::stoull(pid)) == 0;
}

// Removes the segments that killed processes have left under other names: each may be 100 MB of memory. One that is not
// ours to understand, or not to open, stays.
void removeOthersLeftBehind()
{
    std::error_code failed;
    for (auto i = std::filesystem::directory_iterator(segmentFolder, failed); !failed && i != end(i); i.increment(failed)) {
        const std::string file = i->path().filename();
        if (!file.starts_with("palpate-"))
            continue;
        const std::string name = "/" + file;
        const File old(openSegment(name, O_RDWR));
        if (old.descriptor < 0)
            continue;
        const Owner owner = ownerOf(old.descriptor);
        if (owner.pid == 0 && (owner.known || unfinished(file)))
            removeLocked(old, name);
    }
}

constexpr std::size_t aligned(std::size_t bytes)
{
    constexpr std::size_t page = 4096;
    return (bytes + page - 1) / page * page;
}

void checkScenery(const std::string& session, const Scenery& scenery, std::size_t labels, std::size_t image,
                  std::size_t fine)
{
    base::failIf(fine != voxelsOf(scenery.fine), "session {}: {} fine labels for a grid of {}", session, fine,
                 voxelsOf(scenery.fine));
    base::failIf(labels == 0 || labels != voxelsOf(scenery.labels), "session {}: {} labels for a grid of {}", session,
                 labels, voxelsOf(scenery.labels));
    base::failIf(scenery.windows > maxWindows || image != (scenery.windows > 0 ? labels : 0),
                 "session {}: an image of {} voxels with {} windows, for {} labels", session, image, scenery.windows,
                 labels);
    base::failIf(scenery.tissues > maxTissues || scenery.structures > maxStructures,
                 "session {}: at most {} tissues and {} structures can be shown", session, maxTissues, maxStructures);
    base::failIf(!sound(scenery), "session {}: its scenery has a grid, a colour, a name or a length that no viewer shows",
                 session);
}

std::uint64_t now() noexcept
{
    timespec t{};
    ::clock_gettime(CLOCK_MONOTONIC, &t);
    return static_cast<std::uint64_t>(t.tv_sec) * 1000000000U + static_cast<std::uint64_t>(t.tv_nsec);
}

}  // namespace

struct Publisher::Impl {
    Impl(const std::string& sessionName, const Scenery& scenery, std::span<const std::uint8_t> labels,
         std::span<const std::uint16_t> image, std::span<const std::uint8_t> fine);
    ~Impl();
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;

    void allocate(std::size_t size);
    void fill(const Scenery& scenery, std::span<const std::uint8_t> labels, std::span<const std::uint16_t> image,
              std::span<const std::uint8_t> fine);
    void show();
    void release() noexcept;

    std::string session, name, temporary;
    int descriptor = -1;
    std::byte* base = nullptr;
    std::size_t bytes = 0;
    Header* header = nullptr;
    StateBlock* state = nullptr;
    InputBlock* input = nullptr;
    DisplacedBlock* displaced = nullptr;
    MappingGuard guard;
    std::uint64_t owner = static_cast<std::uint64_t>(::getpid());
    std::uint64_t publication = 0;
    std::unique_ptr<Displaced> back = std::make_unique<Displaced>();
};

Publisher::Impl::Impl(const std::string& sessionName, const Scenery& scenery, std::span<const std::uint8_t> labels,
                      std::span<const std::uint16_t> image, std::span<const std::uint8_t> fine)
    : session(sessionName), name(segmentName(sessionName)), temporary(name + "." + std::to_string(::getpid()))
{
    checkScenery(session, scenery, labels.size(), image.size(), fine.size());
    removeLeftBehind(session, name);
    removeOthersLeftBehind();
    const std::size_t scene = aligned(sizeof(Header)), label = scene + aligned(sizeof(Scenery)),
                      grey = label + aligned(labels.size()), detail = grey + aligned(image.size_bytes()),
                      states = detail + aligned(fine.size()), inputs = states + aligned(sizeof(StateBlock)),
                      displacements = inputs + aligned(sizeof(InputBlock));
    try {
        allocate(displacements + aligned(sizeof(DisplacedBlock)));
        header = new (base) Header;
        header->sceneryOffset = scene;
        header->labelsOffset = label;
        header->labelsBytes = labels.size();
        header->imageOffset = grey;
        header->imageBytes = image.size_bytes();
        header->fineOffset = detail;
        header->fineBytes = fine.size();
        header->stateOffset = states;
        header->inputOffset = inputs;
        header->displacedOffset = displacements;
        fill(scenery, labels, image, fine);
        show();
    } catch (...) {
        release();
        throw;
    }
}

void Publisher::Impl::allocate(std::size_t size)
{
    bytes = size;
    descriptor = ::shm_open(temporary.c_str(), O_RDWR | O_CREAT | O_EXCL, S_IRUSR | S_IWUSR);
    if (descriptor < 0)
        fail(session, "cannot make shared memory", errno);
    // Reserved now, so that a full /dev/shm is an error here and not a SIGBUS in the servo loop.
    if (const int error = ::posix_fallocate(descriptor, 0, static_cast<off_t>(bytes)))
        fail(session, "no room for " + std::to_string(bytes >> 20U) + " MB in " + segmentFolder, error);
    void* mapped = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, descriptor, 0);
    if (mapped == MAP_FAILED)
        fail(session, "cannot map shared memory", errno);
    base = static_cast<std::byte*>(mapped);
    guard = MappingGuard(mapped, bytes);
}

void Publisher::Impl::fill(const Scenery& scenery, std::span<const std::uint8_t> labels,
                           std::span<const std::uint16_t> image, std::span<const std::uint8_t> fine)
{
    header->version = version;
    header->layoutHash = layoutHash();
    header->bytes = bytes;
    header->ownerPid = static_cast<std::uint64_t>(::getpid());
    header->ownerStart = processStart(header->ownerPid);
    header->closed.store(0, std::memory_order_relaxed);
    new (base + header->sceneryOffset) Scenery(scenery);
    std::memcpy(base + header->labelsOffset, labels.data(), labels.size());
    if (!image.empty())
        std::memcpy(base + header->imageOffset, image.data(), image.size_bytes());
    if (!fine.empty())
        std::memcpy(base + header->fineOffset, fine.data(), fine.size());
    state = new (base + header->stateOffset) StateBlock;
    input = new (base + header->inputOffset) InputBlock;
    displaced = new (base + header->displacedOffset) DisplacedBlock;
    header->magic.store(magic, std::memory_order_release);
}

// A link, not a rename: it fails when another publisher has been faster.
void Publisher::Impl::show()
{
    const std::string folder(segmentFolder);
    if (::link((folder + temporary).c_str(), (folder + name).c_str()) != 0) {
        base::failIf(errno == EEXIST, "session {} has just been started by another process", session);
        fail(session, "cannot show shared memory", errno);
    }
    ::shm_unlink(temporary.c_str());
    temporary.clear();
}

void Publisher::Impl::release() noexcept
{
    if (!temporary.empty() && descriptor >= 0)
        ::shm_unlink(temporary.c_str());
    guard = {};
    if (base != nullptr)
        ::munmap(base, bytes);
    if (descriptor >= 0)
        ::close(descriptor);
}

Publisher::Impl::~Impl()
{
    // A forked child holds a copy of this object, but not the session.
    if (owner == static_cast<std::uint64_t>(::getpid())) {
        header->closed.store(1, std::memory_order_release);
        if (sameFile(descriptor, name))
            ::shm_unlink(name.c_str());
    }
    release();
}

Publisher::Publisher(const std::string& session, const Scenery& scenery, std::span<const std::uint8_t> labels,
                     std::span<const std::uint16_t> image, std::span<const std::uint8_t> fine)
    : impl_(std::make_unique<Impl>(session, scenery, labels, image, fine))
{
}

Publisher::Publisher(Publisher&&) noexcept = default;
Publisher::~Publisher() = default;

void Publisher::setState(const State& state) noexcept
{
    auto words = std::bit_cast<std::array<std::uint64_t, stateWords>>(state);
    if (state.published == 0)
        words[offsetof(State, published) / sizeof(std::uint64_t)] = now();
    writeLocked(*impl_->state, words);
}

// A viewer that was stopped in the middle of a write is no reason to wait.
std::optional<Input> Publisher::input() const noexcept
{
    constexpr int tries = 4;
    const auto words = readLocked<inputWords>(*impl_->input, tries);
    return words ? std::optional(std::bit_cast<Input>(*words)) : std::nullopt;
}

bool Publisher::torn() const noexcept
{
    return impl_->guard.torn();
}

Displaced& Publisher::backBuffer() noexcept
{
    return *impl_->back;
}

void Publisher::publishDisplaced() noexcept
{
    const Displaced& back = *impl_->back;
    const std::size_t count = std::min<std::size_t>(back.count, maxDisplaced);
    const std::uint64_t publication = ++impl_->publication;
    DisplacedSlot& slot = impl_->displaced->slot[publication % displacedSlots];
    const std::uint64_t sequence = slot.sequence.load(std::memory_order_relaxed);

    slot.sequence.store(sequence + 1, std::memory_order_relaxed);
    slot.tick.store(back.tick, std::memory_order_release);
    slot.publication.store(publication, std::memory_order_release);
    slot.count.store(count, std::memory_order_release);
    for (std::size_t i = 0; i < count; ++i) {
        const auto words = std::bit_cast<std::array<std::uint64_t, displacementWords>>(back.nodes[i]);
        for (std::size_t k = 0; k < displacementWords; ++k)
            slot.words[i * displacementWords + k].store(words[k], std::memory_order_release);
    }
    slot.sequence.store(sequence + 2, std::memory_order_release);
    impl_->displaced->latest.store(publication, std::memory_order_release);
}

}  // namespace palpate::channel
