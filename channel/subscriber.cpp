#include <base/error.h>
#include <channel/bounds.h>
#include <channel/channel.h>
#include <channel/mapping_guard.h>
#include <channel/segment.h>

#include <fcntl.h>
#include <sys/mman.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>

namespace palpate::channel {
namespace {

// A write takes well under a microsecond; whoever fails this often in a row looks at a write that was never finished.
constexpr int stateTries = 10000;
constexpr int displacedTries = 16;

bool within(std::uint64_t offset, std::uint64_t length, std::uint64_t bytes) noexcept
{
    return offset <= bytes && length <= bytes - offset && offset % alignof(Word) == 0;
}

// Where things are, as it was checked: who may write the segment may change it afterwards.
struct Places {
    std::uint64_t version = 0, layoutHash = 0, bytes = 0, ownerPid = 0, ownerStart = 0, scenery = 0, labels = 0,
                  labelsBytes = 0, image = 0, imageBytes = 0, fine = 0, fineBytes = 0, state = 0, input = 0, displaced = 0;
};

Places placesIn(const Header& h) noexcept
{
    return {h.version,       h.layoutHash,   h.bytes,       h.ownerPid,    h.ownerStart,
            h.sceneryOffset, h.labelsOffset, h.labelsBytes, h.imageOffset, h.imageBytes,
            h.fineOffset,    h.fineBytes,    h.stateOffset, h.inputOffset, h.displacedOffset};
}

// Whether labels, fine labels and image are as large as the scenery says.
bool coherent(const Places& header, const Scenery& scenery) noexcept
{
    const std::uint64_t voxels = voxelsOf(scenery.labels);
    return sound(scenery) && header.labelsBytes == voxels &&
           header.imageBytes == (scenery.windows > 0 ? voxels * sizeof(std::uint16_t) : 0) &&
           header.fineBytes == voxelsOf(scenery.fine);
}

// Throws when the segment is not one that this program can read.
void check(const std::string& session, const Places& header, std::uint64_t bytes)
{
    const auto refuse = [&](const std::string& what) { throw base::error("session {}: {}", session, what); };
    if (header.version != version)
        refuse("the simulation speaks version " + std::to_string(header.version) + ", this viewer version " +
               std::to_string(version) + "; install both from the same build");
    if (header.layoutHash != layoutHash())
        refuse("the simulation and this viewer were built with different layouts; install both from the same build");
    const bool inside =
        header.bytes == bytes && within(header.scenery, sizeof(Scenery), bytes) &&
        within(header.labels, header.labelsBytes, bytes) && within(header.image, header.imageBytes, bytes) &&
        within(header.fine, header.fineBytes, bytes) && within(header.state, sizeof(StateBlock), bytes) &&
        within(header.input, sizeof(InputBlock), bytes) && within(header.displaced, sizeof(DisplacedBlock), bytes) &&
        header.state % alignof(StateBlock) == 0 && header.displaced % alignof(DisplacedBlock) == 0 &&
        header.input % 4096 == 0;
    if (!inside)
        refuse("its shared memory is damaged; end the simulation and start it again");
}

}  // namespace

struct Subscriber::Impl {
    template <class T>
    const T& at(std::uint64_t offset) const noexcept
    {
        return *reinterpret_cast<const T*>(mapping.base() + offset);
    }

    std::string name;
    std::size_t bytes = 0;
    ino_t inode = 0;
    Mapping mapping;
    const Header* header = nullptr;
    Places places;
    Scenery scenery;
    std::uint64_t nodes = 0;  // of the lattice
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
    const base::Descriptor file = openSegment(impl.name, O_RDONLY);
    if (!file && errno == ENOENT)
        return std::nullopt;
    base::failIf(!file, "session {}: cannot be read: {} (only the user who started it may)", session, std::strerror(errno));
    const struct stat status = statusOf(file);
    impl.bytes = static_cast<std::size_t>(status.st_size);
    impl.inode = status.st_ino;
    if (impl.bytes >= sizeof(Header))
        impl.mapping = Mapping(*file, impl.bytes, PROT_READ);
    base::failIf(impl.bytes >= sizeof(Header) && !impl.mapping,
                 "session {}: its shared memory of {} MB cannot be mapped: {}; end other programs", session,
                 impl.bytes / 1000000, std::strerror(errno));
    impl.header = impl.mapping ? &impl.at<Header>(0) : nullptr;
    base::failIf(impl.header == nullptr || impl.header->magic.load(std::memory_order_acquire) != magic,
                 "session {}: its shared memory was not made by palpate; remove {}", session, segmentFolder + impl.name);
    impl.places = placesIn(*impl.header);
    check(session, impl.places, impl.bytes);
    std::memcpy(&impl.scenery, &impl.at<std::byte>(impl.places.scenery), sizeof(Scenery));
    base::failIf(!coherent(impl.places, impl.scenery),
                 "session {}: its shared memory is damaged; end the simulation and start it again", session);
    if (!ownerLives(impl.places))
        return std::nullopt;
    impl.nodes = voxelsOf(impl.scenery.lattice);
    impl.state = &impl.at<StateBlock>(impl.places.state);
    impl.input = &impl.at<InputBlock>(impl.places.input);
    impl.displaced = &impl.at<DisplacedBlock>(impl.places.displaced);
    return subscriber;
}

const Scenery& Subscriber::scenery() const noexcept
{
    return impl_->scenery;
}

std::span<const std::uint8_t> Subscriber::labels() const noexcept
{
    return {&impl_->at<std::uint8_t>(impl_->places.labels), impl_->places.labelsBytes};
}

std::span<const std::uint16_t> Subscriber::image() const noexcept
{
    return {&impl_->at<std::uint16_t>(impl_->places.image), impl_->places.imageBytes / sizeof(std::uint16_t)};
}

std::span<const std::uint8_t> Subscriber::fine() const noexcept
{
    return {&impl_->at<std::uint8_t>(impl_->places.fine), impl_->places.fineBytes};
}

std::optional<State> Subscriber::state() const noexcept
{
    const auto words = readLocked<stateWords>(*impl_->state, stateTries);
    auto state = words ? std::optional(std::bit_cast<State>(*words)) : std::nullopt;
    return state && sound(*state, impl_->scenery) ? state : std::nullopt;
}

std::optional<Input> Subscriber::input() const noexcept
{
    const auto words = readLocked<inputWords>(*impl_->input, stateTries);
    auto input = words ? std::optional(std::bit_cast<Input>(*words)) : std::nullopt;
    return input && sound(*input) ? input : std::nullopt;
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
            const auto given = std::span(out.nodes).first(count);
            if (!std::all_of(given.begin(), given.end(), [&](const Displacement& d) { return sound(d, impl_->nodes); }))
                return false;
            out.tick = tick;
            out.publication = publication;
            out.count = static_cast<std::uint32_t>(count);
            return true;
        }
    }
    return false;
}

Mapping Subscriber::inputToWrite() const
{
    const base::Descriptor file = openSegment(impl_->name, O_RDWR);
    if (statusOf(file).st_ino != impl_->inode)
        return {};
    return {*file, sizeof(InputBlock), PROT_READ | PROT_WRITE, impl_->places.input};
}

Ending Subscriber::ending() const noexcept
{
    if (impl_->header->closed.load(std::memory_order_acquire) != 0)
        return Ending::finished;
    if (const auto last = state(); last && last->status == Status::finished)
        return Ending::finished;
    if (impl_->mapping.torn())
        return Ending::torn;
    if (!ownerLives(impl_->places))
        return Ending::killed;
    const struct stat named = statusOf(openSegment(impl_->name, O_RDONLY));
    if (named.st_ino != impl_->inode)
        return Ending::killed;
    return static_cast<std::uint64_t>(named.st_size) < impl_->bytes ? Ending::torn : Ending::none;
}

std::uint64_t Subscriber::ownerPid() const noexcept
{
    return impl_->places.ownerPid;
}

std::vector<std::string> sessions()
{
    std::vector<std::string> found;
    for (const std::string& file : segmentFiles()) {
        try {
            std::string session = file.substr(segmentPrefix.size());
            const auto subscriber = Subscriber::attach(session);
            if (subscriber && subscriber->alive())
                found.push_back(std::move(session));
        } catch (const std::exception&) {
            continue;  // another user's, another version's, or one that is being made
        }
    }
    return found;
}

}  // namespace palpate::channel
