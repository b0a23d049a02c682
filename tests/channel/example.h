#pragma once

#include <channel/channel.h>

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <stdexcept>
#include <string>
#include <vector>

namespace palpate::channel {

// A session name that no other test process uses.
inline std::string sessionNamed(const std::string& what)
{
    return "test-" + std::to_string(::getpid()) + "-" + what;
}

inline Scenery smallScenery()
{
    Scenery scenery;
    scenery.scene = {"cube"};
    scenery.labels.size = {5, 4, 3};
    scenery.labels.spacing = 0.001;
    scenery.lattice = scenery.labels;
    scenery.lattice.size = {10, 10, 10};
    scenery.tissues = 2;
    scenery.structures = 1;
    scenery.forceCap = 8.5;
    return scenery;
}

inline std::vector<std::uint8_t> smallLabels()
{
    std::vector<std::uint8_t> labels(60);
    for (std::size_t i = 0; i < labels.size(); ++i)
        labels[i] = static_cast<std::uint8_t>(i % 2);
    return labels;
}

inline Scenery fineScenery()
{
    Scenery scenery = smallScenery();
    scenery.fine.size = {9, 7, 5};
    scenery.fine.spacing = 0.0005;
    scenery.sound[1] = {1540, 1060, 0.7F, 1, 3, 4, 3};
    scenery.probe = ProbeKind::linear;
    return scenery;
}

inline std::vector<std::uint8_t> finelyLabelled()
{
    std::vector<std::uint8_t> labels(9 * 7 * 5);
    for (std::size_t i = 0; i < labels.size(); ++i)
        labels[i] = static_cast<std::uint8_t>(i % 3 % 2);
    return labels;
}

// A state in which every number follows from `tick`, so that a copy mixed from two ticks shows.
inline State stateOf(std::uint64_t tick)
{
    const double x = static_cast<double>(tick);
    State state;
    state.tick = tick;
    state.time = x;
    state.tip = state.axis = state.proxy = {1e-6 * x, 1e-6 * x + 1, 1e-6 * x + 2};
    state.basic = state.additional = state.total = state.tip;
    state.distance.fill(x);
    state.coreLength = 1e-6 * x;
    state.missed = tick;
    state.published = tick + 1;
    return state;
}

inline bool whole(const State& state)
{
    const State expected = stateOf(state.tick);
    return state.time == expected.time && state.tip == expected.tip && state.axis == expected.axis &&
           state.proxy == expected.proxy && state.basic == expected.basic && state.additional == expected.additional &&
           state.total == expected.total && state.distance == expected.distance &&
           state.coreLength == expected.coreLength && state.missed == expected.missed &&
           state.published == expected.published;
}

inline void fillDisplaced(Displaced& displaced, std::uint64_t tick)
{
    displaced.tick = tick;
    displaced.count = static_cast<std::uint32_t>(500 + tick % 500);
    for (std::uint32_t i = 0; i < displaced.count; ++i)
        displaced.nodes[i] = {
            i, {1e-6F * static_cast<float>(tick), 1e-3F * static_cast<float>(i), 1e-6F * static_cast<float>(tick)}};
}

inline bool whole(const Displaced& displaced)
{
    if (displaced.count != 500 + displaced.tick % 500)
        return false;
    for (std::uint32_t i = 0; i < displaced.count; ++i) {
        const Displacement& d = displaced.nodes[i];
        if (d.node != i || d.u[0] != 1e-6F * static_cast<float>(displaced.tick) || d.u[2] != d.u[0])
            return false;
    }
    return true;
}

// The bytes of a session's segment, to be damaged.
class RawSegment {
public:
    explicit RawSegment(const std::string& name, std::size_t createWith = 0)
    {
        const int file = ::shm_open(name.c_str(), O_RDWR | (createWith != 0 ? O_CREAT : 0), 0600);
        if (file < 0 || (createWith != 0 && ::ftruncate(file, static_cast<off_t>(createWith)) != 0))
            throw std::runtime_error(name + ": cannot be opened");
        bytes_ = static_cast<std::size_t>(::lseek(file, 0, SEEK_END));
        base_ = ::mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
        ::close(file);
    }
    RawSegment(const RawSegment&) = delete;
    RawSegment& operator=(const RawSegment&) = delete;
    ~RawSegment() { ::munmap(base_, bytes_); }

    template <class T>
    T& at(std::size_t offset)
    {
        return *reinterpret_cast<T*>(static_cast<std::byte*>(base_) + offset);
    }

    std::size_t bytes() const noexcept { return bytes_; }

private:
    void* base_ = nullptr;
    std::size_t bytes_ = 0;
};

}  // namespace palpate::channel
