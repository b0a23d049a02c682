#include <tests/apps/program.h>

#include <base/inputs.h>

#include <gtest/gtest.h>

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <utility>

namespace palpate::apps {

namespace {

std::string programFile(const std::string& name)
{
    return std::filesystem::path(PALPATE_BIN_DIR) / name;
}

std::vector<char*> pointers(std::vector<std::string>& words)
{
    std::vector<char*> out;
    for (std::string& word : words) {
        out.push_back(word.data());
    }
    out.push_back(nullptr);
    return out;
}

std::vector<std::string> environmentWithoutDisplay()
{
    std::vector<std::string> out;
    for (char** entry = environ; *entry != nullptr; ++entry) {
        if (std::strncmp(*entry, "DISPLAY=", 8) != 0) {
            out.emplace_back(*entry);
        }
    }
    return out;
}

}  // namespace

Program::Program(const std::string& name, const std::vector<std::string>& arguments)
{
    std::vector<std::string> words{programFile(name)};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<std::string> environment = environmentWithoutDisplay();

    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    constexpr int flags = O_WRONLY | O_CREAT | O_TRUNC;
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, (folder_ / "out").c_str(), flags, 0600);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, (folder_ / "err").c_str(), flags, 0600);
    const int error =
        posix_spawn(&pid_, words[0].c_str(), &actions, nullptr, pointers(words).data(), pointers(environment).data());
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) {
        pid_ = -1;
        throw std::runtime_error(words[0] + ": " + std::strerror(error));
    }
}

Program::~Program()
{
    if (pid_ > 0) {
        kill(pid_, SIGKILL);
        wait();
    }
}

void Program::send(int signal)
{
    if (pid_ > 0) {
        kill(pid_, signal);
    }
}

Outcome Program::wait()
{
    if (pid_ > 0) {
        waitpid(pid_, &status_, 0);
        pid_ = -1;
    }
    const int status = WIFEXITED(status_) ? WEXITSTATUS(status_) : -WTERMSIG(status_);
    return {status, readText(folder_ / "out"), readText(folder_ / "err")};
}

bool Program::running()
{
    if (pid_ > 0 && waitpid(pid_, &status_, WNOHANG) == pid_) {
        pid_ = -1;
    }
    return pid_ > 0;
}

bool catches(Program& program, int signal)
{
    using namespace std::chrono_literals;
    const std::string status = "/proc/" + std::to_string(program.pid()) + "/status", key = "SigCgt:";
    for (int i = 0; i < 1000 && program.running(); ++i) {
        const std::string text = readText(status);
        const auto at = text.find(key);
        const auto caught = at == std::string::npos ? 0 : std::stoull(text.substr(at + key.size()), nullptr, 16);
        if ((caught >> (signal - 1) & 1) != 0) {
            return true;
        }
        std::this_thread::sleep_for(20ms);
    }
    return false;
}

bool built(const std::string& name)
{
    return std::filesystem::exists(programFile(name));
}

Outcome palpate(const std::vector<std::string>& arguments)
{
    return Program("palpate", arguments).wait();
}

nlohmann::json figures(std::vector<std::string> arguments)
{
    const Folder folder;
    arguments.insert(arguments.end(), {"--json", folder / "figures.json"});
    const Outcome outcome = palpate(arguments);
    if (outcome.status != 0) {
        throw std::runtime_error(arguments[0] + ": exit status " + std::to_string(outcome.status) + ": " + outcome.err);
    }
    return nlohmann::json::parse(readText(folder / "figures.json"));
}

const std::string& smallLayered()
{
    static const Folder folder;
    static const std::string file = [] {
        const std::string to = folder / "layered.toml";
        std::string text = readText(PALPATE_SOURCE_DIR "/datasets/scenes/layered.toml");
        for (const auto& [old, fresh] : {std::pair<std::string_view, std::string_view>{"voxel_mm = 1.0", "voxel_mm = 2.0"},
                                         {"[volume.parameters]", "[volume.parameters]\nwidth_mm = 40"}}) {
            text.replace(text.find(old), old.size(), fresh);  // throws where it is not there
        }
        writeText(to, text);
        return to;
    }();
    return file;
}

const std::string& threeSeconds()
{
    static const Folder folder;
    static const std::string record = [] {
        const std::string to = folder / "s.db";
        figures({"train", smallLayered(), "--unpaced", "--no-view", "--seconds", "3", "--record", to});
        return to;
    }();
    return record;
}

void expectRefusal(const std::vector<std::string>& arguments, const std::string& hint)
{
    std::string line = "palpate";
    for (const std::string& word : arguments) {
        line += " " + word;
    }
    SCOPED_TRACE(line);
    const Outcome outcome = palpate(arguments);
    EXPECT_GT(outcome.status, 0) << "it must end by itself with a status that is not 0";
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_TRUE(outcome.err.starts_with("palpate: ")) << outcome.err;
    EXPECT_NE(outcome.err.find(hint), std::string::npos) << outcome.err << "  does not hold: " << hint;
}

std::string readText(const std::filesystem::path& file)
{
    return base::contentOf(file).value_or("");
}

void writeText(const std::filesystem::path& file, const std::string& text)
{
    std::ofstream(file, std::ios::binary) << text;
}

}  // namespace palpate::apps
