#pragma once

#include <volume/geometry.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

namespace palpate::haptics {

/// A straight stretch of tissue that gave way, at rest: a cylinder with flat ends.
struct Channel {
    Vec3 from{0.0};       // middle of its first end [m]
    Vec3 along{0, 1, 0};  // unit vector to its other end
    double length = 0;    // [m]
    double radius = 0;    // [m]

    bool contains(Vec3 p) const noexcept;
};

/// Room for `capacity` channels; further ones take the place of the oldest.
template <std::size_t capacity>
class Channels {
public:
    void add(const Channel& channel) noexcept { channels_[added_++ % capacity] = channel; }
    Channel* last() noexcept { return added_ > 0 ? &channels_[(added_ - 1) % capacity] : nullptr; }
    std::span<const Channel> all() const noexcept { return std::span(channels_).first(std::min(added_, capacity)); }

private:
    std::array<Channel, capacity> channels_{};
    std::size_t added_ = 0;
};

/// What needles have done to the tissue in a session, in rest space. The volume itself stays as it is.
struct Cuts {
    Channels<64> paths;   // cut by the tip: closed again, and open to a needle that comes the same way
    Channels<256> cores;  // taken by the gun, in coreChannels pieces each: nothing is there any more
};

inline constexpr int coreChannels = 8;

/// The holes that reach into a ball, so that its points need not look at all of them; beyond `most` none is known. The cuts
/// must outlive it.
class HolesNear {
public:
    static constexpr std::size_t most = 64;
    HolesNear(const Cuts& cuts, Vec3 middle, double radius) noexcept;
    bool contain(Vec3 rest) const noexcept;

private:
    std::array<const Channel*, most> hole_{};
    std::size_t count_ = 0;
};

/// Whether the tissue at `rest` was taken with a core.
bool taken(const Cuts& cuts, Vec3 rest) noexcept;

/// How far from `p` along `axis` a needle's tip meets nothing to cut, through paths and holes [m]. Bounded work.
double openAhead(const Cuts& cuts, Vec3 p, Vec3 axis) noexcept;

/// Notes that the tip of a needle of this radius has cut from `from` to `to` [m]: the last path grows, or where `from` is
/// not at its end or `to` not in its direction, another begins.
void cutPath(Cuts& cuts, Vec3 from, Vec3 to, double radius) noexcept;

}  // namespace palpate::haptics
