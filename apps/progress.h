#pragma once

#include <chrono>
#include <string>

namespace palpate::apps {

/// One line on a terminal (standard error) that says what is going on, once that takes over two seconds; nothing elsewhere.
class Progress {
public:
    Progress();
    ~Progress() { clear(); }
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;

    void show(const std::string& what);
    /// Takes the line away, so that something else can be printed.
    void clear();

private:
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
    bool terminal_;
    bool shown_ = false;
};

}  // namespace palpate::apps
