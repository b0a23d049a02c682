#pragma once

#include <trainer/running.h>

#include <filesystem>
#include <optional>
#include <string>

namespace palpate::trainer {

/// A film of a session, while it is made: with ffmpeg a film, without it pictures. It has its name when it is whole: what
/// is cut off does not look like one. Not part of the interface.
class Film {
public:
    Film() = default;
    /// Ends it; nothing of it stays.
    ~Film();
    Film& operator=(Film&&) = delete;

    /// Throws std::runtime_error where the viewer cannot be started.
    /// @param title  the viewer's option for it
    void make(const std::filesystem::path& programs, const std::filesystem::path& record, const std::string& title,
              const std::filesystem::path& log);
    /// Whether one was made and has come to its end.
    bool ended() noexcept { return viewer_ && viewer_->ended(); }
    /// Says its name in `told`, or in `notice` why there is none: no film of a record that was erased meanwhile is kept.
    /// @pre  it has ended
    void take(std::string& told, std::string& notice);

private:
    void removeHalf() noexcept;

    std::optional<Running> viewer_;
    std::filesystem::path record_, made_, making_;  // of the session; of the film when it is whole, and until then
};

}  // namespace palpate::trainer
