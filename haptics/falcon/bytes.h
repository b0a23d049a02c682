#pragma once

#include <haptics/falcon/transport.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate::falcon {

/// Bytes that came in and were not yet asked for, the oldest first. When it is full the oldest go: newest wins.
class Bytes {
public:
    /// What one transfer brought: in every 64 bytes the first two are the bridge's status and no data.
    void takeTransfer(std::span<const std::uint8_t> transfer) noexcept
    {
        while (!transfer.empty()) {
            const auto packet = transfer.first(std::min(transfer.size(), usbPacket));
            transfer = transfer.subspan(packet.size());
            for (const std::uint8_t byte : packet.subspan(std::min(packet.size(), bridge::statusBytes))) {
                bytes_[(first_ + count_) % bytes_.size()] = byte;
                first_ = count_ == bytes_.size() ? (first_ + 1) % bytes_.size() : first_;
                count_ = std::min(count_ + 1, bytes_.size());
            }
        }
    }

    std::size_t give(std::span<std::uint8_t> into) noexcept
    {
        const std::size_t n = std::min(into.size(), count_);
        for (std::size_t i = 0; i < n; ++i) {
            into[i] = bytes_[(first_ + i) % bytes_.size()];
        }
        first_ = (first_ + n) % bytes_.size();
        count_ -= n;
        return n;
    }

    bool empty() const noexcept { return count_ == 0; }
    void clear() noexcept { count_ = 0; }

private:
    std::array<std::uint8_t, 4096> bytes_{};
    std::size_t first_ = 0, count_ = 0;
};

}  // namespace palpate::falcon
