#pragma once

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace palpate::reference {

/// Things by number that are joined into groups (union-find with path halving).
class Groups {
public:
    /// Each is a group of its own.
    explicit Groups(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0U); }

    /// Makes one group of theirs, whose root is that of `b`.
    void join(std::uint32_t a, std::uint32_t b) { parent_[root(a)] = root(b); }
    /// The one that stands for the group of `i`.
    std::uint32_t root(std::uint32_t i)
    {
        while (parent_[i] != i) {
            parent_[i] = parent_[parent_[i]];
            i = parent_[i];
        }
        return i;
    }

private:
    std::vector<std::uint32_t> parent_;  // (count x 1)
};

}  // namespace palpate::reference
