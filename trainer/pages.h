#pragma once

#include <trainer/running.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace palpate::trainer {

/// Page, table and statements of somebody's progress, while they are written beside the window. Not part of the interface.
class Pages {
public:
    /// Throws std::runtime_error where the command cannot be started.
    /// @param words  of `palpate`, without the files
    /// @param base   of the files, without their endings
    void write(const std::filesystem::path& programs, std::vector<std::string> words, std::filesystem::path base,
               const std::filesystem::path& log);
    bool busy() const noexcept { return command_.has_value(); }
    /// Whether some were written, or could not be.
    bool ended() noexcept { return command_ && command_->ended(); }
    /// Shows the page. Says what was written in `told`, or in `notice` why nothing was.
    /// @pre  it has ended
    void take(std::string& told, std::string& notice);

private:
    std::optional<Running> command_;
    std::filesystem::path base_;
};

/// `base` with the day, the time and the ending behind it, and a number where there is such a file already.
std::filesystem::path freshFile(const std::filesystem::path& base, const std::string& ending);

}  // namespace palpate::trainer
