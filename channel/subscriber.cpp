#include <channel/channel.h>
#include <channel/segment.h>

#include <dirent.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string_view>

namespace palpate::channel {
namespace {

// A write takes well under a microsecond; whoever fails this often in a row looks at a write that was never finished.
constexpr int stateTries = 10000;
constexpr int displacedTries = 16;

bool within(std::uint64_t offset, std::uint64_t length, std::uint64_t bytes) noexcept
{
    return offset <= bytes && length <= bytes - offset && offset % alignof(Word) == 0;
}

// Whether labels and image are as large as the scenery says.
bool coherent(const Header& header, const Scenery& scenery) noexcept
{
    const std::uint64_t voxels = voxelsOf(scenery);
    return header.labelsBytes == voxels && scenery.windows <= maxWindows &&
           header.imageBytes == (scenery.windows > 0 ? voxels * sizeof(std::uint16_t) : 0);
}

// Throws when `header` is not one that this program can read.
void check(const std::string& session, const Header& header, std::uint64_t bytes)
{
    const auto refuse = [&](const std::string& what) { throw std::runtime_error("session " + session + ": " + what); };
    if (header.magic.load(std::memory_order_acquire) != magic)
        refuse("its shared memory was not made by palpate; remove " + (segmentFolder + segmentName(session)));
    if (header.version != version)
        refuse("the simulation speaks version " + std::to_string(header.version) + ", this viewer version " +
               std::to_string(version) + "; install both from the same build");
    if (header.layoutHash != layoutHash())
        refuse("the simulation and this viewer were built with different layouts; install both from the same build");
    const bool sound =
        header.bytes == bytes && within(header.sceneryOffset, sizeof(Scenery), bytes) &&
        within(header.labelsOffset, header.labelsBytes, bytes) && within(header.imageOffset, header.imageBytes, bytes) &&
        within(header.stateOffset, sizeof(StateBlock), bytes) && within(header.inputOffset, sizeof(InputBlock), bytes) &&
        within(header.displacedOffset, sizeof(DisplacedBlock), bytes);
    if (!sound || !coherent(header, *reinterpret_cast<const Scenery*>(reinterpret_cast<const std::byte*>(&header) +
                                                                      header.sceneryOffset)))
        refuse("its shared memory is damaged; end the simulation and start it again");
}

}  // namespace

struct Subscriber::Impl {
    ~Impl()
    {
        if (base != nullptr)
            ::munmap(base, bytes);
    }
    template <class T>
    const T& at(std::uint64_t offset) const noexcept
    {
        return *reinterpret_cast<const T*>(static_cast<const std::byte*>(base) + offset);
    }

    std::string name;
    void* base = nullptr;
    std::size_t bytes = 0;
    ino_t inode = 0;
    const Header* header = nullptr;
    const StateBlock* state = nullptr;
    const InputBlock* input = nullptr;
    const DisplacedBlock* displaced = nullptr;
};

Subscriber::Subscriber() : impl_(std::make_unique<Impl>()) {}
Subscriber::Subscriber(Subscriber&&) noexcept = default;
Subscriber& Subscriber::operator=(Subscriber&&) noexcept = default;
Subscriber::~Subscriber() = default;

std::optional<Subscriber> Subscriber::attach(const std::string& session)
{
    Subscriber subscriber;
    Impl& impl = *subscriber.impl_;
    impl.name = segmentName(session);
    const int file = openSegment(impl.name, O_RDONLY);
    if (file < 0 && errno == ENOENT)
        return std::nullopt;
    if (file < 0)
        throw std::runtime_error("session " + session + ": cannot be read: " + std::strerror(errno) +
                                 " (only the user who started it may)");
    struct stat status {};
    const bool known = ::fstat(file, &status) == 0;
    impl.bytes = static_cast<std::size_t>(status.st_size);
    impl.inode = status.st_ino;
    void* mapped =
        known && impl.bytes >= sizeof(Header) ? ::mmap(nullptr, impl.bytes, PROT_READ, MAP_SHARED, file, 0) : MAP_FAILED;
    ::close(file);
    if (mapped == MAP_FAILED)
        throw std::runtime_error("session " + session + ": its shared memory was not made by palpate; remove " +
                                 (segmentFolder + impl.name));
    impl.base = mapped;
    impl.header = &impl.at<Header>(0);
    check(session, *impl.header, impl.bytes);
    if (!ownerLives(*impl.header))
        return std::nullopt;
    impl.state = &impl.at<StateBlock>(impl.header->stateOffset);
    impl.input = &impl.at<InputBlock>(impl.header->inputOffset);
    impl.displaced = &impl.at<DisplacedBlock>(impl.header->displacedOffset);
    return subscriber;
}

const Scenery& Subscriber::scenery() const noexcept
{
    return impl_->at<Scenery>(impl_->header->sceneryOffset);
}

std::span<const std::uint8_t> Subscriber::labels() const noexcept
{
    return {&impl_->at<std::uint8_t>(impl_->header->labelsOffset), impl_->header->labelsBytes};
}

std::span<const std::uint16_t> Subscriber::image() const noexcept
{
    return {&impl_->at<std::uint16_t>(impl_->header->imageOffset), impl_->header->imageBytes / sizeof(std::uint16_t)};
}

std::optional<State> Subscriber::state() const noexcept
{
    const auto words = readLocked<stateWords>(*impl_->state, stateTries);
    return words ? std::optional(std::bit_cast<State>(*words)) : std::nullopt;
}

std::optional<Input> Subscriber::input() const noexcept
{
    const auto words = readLocked<inputWords>(*impl_->input, stateTries);
    return words ? std::optional(std::bit_cast<Input>(*words)) : std::nullopt;
}

bool Subscriber::displaced(Displaced& out) const noexcept
{
    const DisplacedBlock& block = *impl_->displaced;
    for (int attempt = 0; attempt < displacedTries; ++attempt) {
        const std::uint64_t latest = block.latest.load(std::memory_order_acquire);
        if (latest <= out.publication)
            return false;
        const DisplacedSlot& slot = block.slot[latest % displacedSlots];
        const std::uint64_t before = slot.sequence.load(std::memory_order_acquire);
        const std::uint64_t tick = slot.tick.load(std::memory_order_acquire);
        const std::uint64_t publication = slot.publication.load(std::memory_order_acquire);
        const std::uint64_t count = std::min<std::uint64_t>(slot.count.load(std::memory_order_acquire), maxDisplaced);
        if (before % 2 != 0)
            continue;
        for (std::size_t i = 0; i < count; ++i) {
            std::array<std::uint64_t, displacementWords> words{};
            for (std::size_t k = 0; k < displacementWords; ++k)
                words[k] = slot.words[i * displacementWords + k].load(std::memory_order_acquire);
            out.nodes[i] = std::bit_cast<Displacement>(words);
        }
        if (slot.sequence.load(std::memory_order_relaxed) == before) {
            out.tick = tick;
            out.publication = publication;
            out.count = static_cast<std::uint32_t>(count);
            return true;
        }
    }
    return false;
}

int Subscriber::openToWrite() const noexcept
{
    const int file = openSegment(impl_->name, O_RDWR);
    struct stat named {};
    if (file < 0 || (::fstat(file, &named) == 0 && named.st_ino == impl_->inode))
        return file;
    ::close(file);
    return -1;
}

std::uint64_t Subscriber::inputOffset() const noexcept
{
    return impl_->header->inputOffset;
}

Ending Subscriber::ending() const noexcept
{
    if (impl_->header->closed.load(std::memory_order_acquire) != 0)
        return Ending::finished;
    if (const auto last = state(); last && last->status == Status::finished)
        return Ending::finished;
    if (!ownerLives(*impl_->header))
        return Ending::killed;
    struct stat named {};
    const int file = openSegment(impl_->name, O_RDONLY);
    const bool ours = file >= 0 && ::fstat(file, &named) == 0 && named.st_ino == impl_->inode;
    if (file >= 0)
        ::close(file);
    return ours ? Ending::none : Ending::killed;
}

std::uint64_t Subscriber::ownerPid() const noexcept
{
    return impl_->header->ownerPid;
}

std::vector<std::string> sessions()
{
    constexpr std::string_view prefix = "palpate-";
    std::vector<std::string> found;
    DIR* folder = ::opendir(segmentFolder);
    if (folder == nullptr)
        return found;
    while (const dirent* entry = ::readdir(folder)) {
        const std::string_view file(entry->d_name);
        if (!file.starts_with(prefix))
            continue;
        try {
            std::string session(file.substr(prefix.size()));
            const auto subscriber = Subscriber::attach(session);
            if (subscriber && subscriber->alive())
                found.push_back(std::move(session));
        } catch (const std::exception&) {
            continue;  // another user's, another version's, or one that is being made
        }
    }
    ::closedir(folder);
    std::sort(found.begin(), found.end());
    return found;
}

}  // namespace palpate::channel
