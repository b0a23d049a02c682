#include <base/error.h>
#include <channel/bounds.h>
#include <channel/channel.h>
#include <channel/mapping_guard.h>
#include <channel/segment.h>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <new>

namespace palpate::channel {
namespace {

[[noreturn]] void fail(const std::string& session, const std::string& what, int error)
{
    throw base::error("session {}: {}: {}", session, what, std::strerror(error));
}

bool sameFile(const base::Descriptor& file, const std::string& name)
{
    const struct stat ours = statusOf(file), named = statusOf(openSegment(name, O_RDONLY));
    return named.st_ino != 0 && ours.st_ino == named.st_ino && ours.st_dev == named.st_dev;
}

struct NameGoes {
    ~NameGoes() { ::shm_unlink(name.c_str()); }
    const std::string& name;
};

struct Owner {
    bool known = false;     // the segment is one of ours, complete and laid out as here
    std::uint64_t pid = 0;  // 0: dead
};

Owner ownerOf(const base::Descriptor& file)
{
    if (static_cast<std::size_t>(statusOf(file).st_size) < sizeof(Header))
        return {};
    const Mapping mapping(*file, sizeof(Header), PROT_READ);
    const auto* header = mapping ? reinterpret_cast<const Header*>(mapping.base()) : nullptr;
    if (header == nullptr || header->magic.load(std::memory_order_acquire) != magic)
        return {};
    return {header->version == version && header->layoutHash == layoutHash(), ownerLives(*header) ? header->ownerPid : 0};
}

// Removes the segment `name` that is open as `old`. The lock on it lets only one process at a time do so, and the second
// look at the name keeps a slower one from removing what a faster one has put there. Who does not get the lock leaves it to
// who has. A publisher shares the lock of its own as long as it lives, so that it goes nowhere, also where its process
// cannot be seen from here (another container with the same /dev/shm).
void removeLocked(const base::Descriptor& old, const std::string& name)
{
    if (::flock(*old, LOCK_EX | LOCK_NB) == 0 && sameFile(old, name))
        ::shm_unlink(name.c_str());
}

// Removes the segment `name` if a dead process left it, or if it is not ours to understand.
void removeLeftBehind(const std::string& session, const std::string& name)
{
    const base::Descriptor old = openSegment(name, O_RDWR);
    if (!old && errno == ENOENT)
        return;
    if (!old)
        fail(session, "there is one already that belongs to somebody else (choose another --session)", errno);
    const std::uint64_t pid = ownerOf(old).pid;
    base::failIf(pid != 0, "session {} is running already (pid {}): end it or choose another --session", session, pid);
    removeLocked(old, name);
    base::failIf(::flock(*old, LOCK_SH | LOCK_NB) == 0 && sameFile(old, name),
                 "session {} is running already, out of sight of this process (in another container): end it or choose "
                 "another --session",
                 session);
}

// Whether `file` is the temporary name of a process that is dead.
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
    for (const std::string& file : segmentFiles()) {
        const std::string name = "/" + file;
        const base::Descriptor old = openSegment(name, O_RDWR);
        const Owner owner = old ? ownerOf(old) : Owner{};
        if (old && owner.pid == 0 && (owner.known || unfinished(file)))
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

    void map(std::size_t bytes);
    void fill(const Scenery& scenery, std::span<const std::uint8_t> labels, std::span<const std::uint16_t> image,
              std::span<const std::uint8_t> fine);

    std::string session, name;
    base::Descriptor file;
    Mapping mapping;
    Header* header = nullptr;
    StateBlock* state = nullptr;
    InputBlock* input = nullptr;
    DisplacedBlock* displaced = nullptr;
    std::uint64_t owner = static_cast<std::uint64_t>(::getpid());
    std::uint64_t publication = 0;
    std::unique_ptr<Displaced> back = std::make_unique<Displaced>();
};

Publisher::Impl::Impl(const std::string& sessionName, const Scenery& scenery, std::span<const std::uint8_t> labels,
                      std::span<const std::uint16_t> image, std::span<const std::uint8_t> fine)
    : session(sessionName), name(segmentName(sessionName))
{
    checkScenery(session, scenery, labels.size(), image.size(), fine.size());
    removeLeftBehind(session, name);
    removeOthersLeftBehind();
    const std::size_t scene = aligned(sizeof(Header)), label = scene + aligned(sizeof(Scenery)),
                      grey = label + aligned(labels.size()), detail = grey + aligned(image.size_bytes()),
                      states = detail + aligned(fine.size()), inputs = states + aligned(sizeof(StateBlock)),
                      displacements = inputs + aligned(sizeof(InputBlock));
    const std::string temporary = name + "." + std::to_string(::getpid());
    file = base::Descriptor(::shm_open(temporary.c_str(), O_RDWR | O_CREAT | O_EXCL, S_IRUSR | S_IWUSR));
    // The mode asked for is less what the umask takes, which may be all of it.
    if (!file || ::fchmod(*file, S_IRUSR | S_IWUSR) != 0 || ::flock(*file, LOCK_SH | LOCK_NB) != 0)
        fail(session, "cannot make shared memory", errno);
    const NameGoes goes{temporary};
    map(displacements + aligned(sizeof(DisplacedBlock)));
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
    // A link, not a rename: it fails when another publisher has been faster.
    const std::string folder(segmentFolder);
    if (::link((folder + temporary).c_str(), (folder + name).c_str()) != 0) {
        base::failIf(errno == EEXIST, "session {} has just been started by another process", session);
        fail(session, "cannot show shared memory", errno);
    }
}

void Publisher::Impl::map(std::size_t bytes)
{
    // Reserved now, so that a full /dev/shm is an error here and not a SIGBUS in the servo loop.
    if (const int error = ::posix_fallocate(*file, 0, static_cast<off_t>(bytes)))
        fail(session, "no room for " + std::to_string(bytes >> 20U) + " MB in " + segmentFolder, error);
    mapping = Mapping(*file, bytes, PROT_READ | PROT_WRITE, 0, MAP_POPULATE);
    if (!mapping)
        fail(session, "cannot map shared memory", errno);
    header = new (mapping.base()) Header;
    header->bytes = bytes;
}

void Publisher::Impl::fill(const Scenery& scenery, std::span<const std::uint8_t> labels,
                           std::span<const std::uint16_t> image, std::span<const std::uint8_t> fine)
{
    std::byte* const base = mapping.base();
    header->version = version;
    header->layoutHash = layoutHash();
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

Publisher::Impl::~Impl()
{
    // A forked child holds a copy of this object, but not the session.
    if (owner == static_cast<std::uint64_t>(::getpid())) {
        header->closed.store(1, std::memory_order_release);
        if (sameFile(file, name))
            ::shm_unlink(name.c_str());
    }
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
    return impl_->mapping.torn();
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
