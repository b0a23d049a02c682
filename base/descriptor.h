#pragma once

#include <unistd.h>

#include <utility>

namespace palpate::base {

/// The number of an open file, closed with its holder; below 0: none is open.
class Descriptor {
public:
    explicit Descriptor(int number = -1) noexcept : number_(number) {}
    Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
    Descriptor& operator=(Descriptor other) noexcept
    {
        std::swap(number_, other.number_);
        return *this;
    }
    ~Descriptor()
    {
        if (number_ >= 0) {
            ::close(number_);
        }
    }

    explicit operator bool() const noexcept { return number_ >= 0; }
    int operator*() const noexcept { return number_; }

private:
    int number_;
};

}  // namespace palpate::base
