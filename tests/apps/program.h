#pragma once

#include <tests/folder.h>

#include <nlohmann/json.hpp>

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::apps {

using tests::Folder;

/// How a program ended, and what it printed.
struct Outcome {
    int status = 0;  // exit status, or minus the signal that ended it
    std::string out, err;
};

/// A program of ours as a user starts it, without a display.
class Program {
public:
    /// `name`: palpate or palpate-view, or the whole path of a copy.
    Program(const std::string& name, const std::vector<std::string>& arguments);
    /// Kills it when it still runs.
    ~Program();
    Program(const Program&) = delete;
    Program& operator=(const Program&) = delete;

    void send(int signal);
    Outcome wait();
    bool running();
    int pid() const noexcept { return pid_; }

private:
    Folder folder_;  // of its standard output and error
    int pid_ = -1;
    int status_ = 0;
};

/// Waits until a program that has just been started handles a signal; false: it does not, or has ended.
bool catches(Program& program, int signal);

/// Whether the program was built.
bool built(const std::string& name);

/// `palpate ARGUMENTS` from start to end.
Outcome palpate(const std::vector<std::string>& arguments);

/// As palpate(); it has to succeed. Returns the figures of --json, which this adds.
nlohmann::json figures(std::vector<std::string> arguments);

/// A scene: the built-in layered one on a body of 40 instead of 80 mm and in voxels of 2 mm. A session in it is the same,
/// and begins in a quarter of the time.
const std::string& smallLayered();

/// The record of three seconds in it without a clock, 3000 ticks: once for all tests of a process, which must not change
/// it.
const std::string& threeSeconds();

/// Checks that `palpate ARGUMENTS` fails with one line that names the program and holds `hint`.
void expectRefusal(const std::vector<std::string>& arguments, const std::string& hint);

std::string readText(const std::filesystem::path& file);
void writeText(const std::filesystem::path& file, const std::string& text);

}  // namespace palpate::apps
