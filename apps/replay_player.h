#pragma once

#include <haptics/recorder.h>
#include <render/viewer.h>

#include <memory>
#include <string>

namespace palpate::apps {

/// Plays a record to a viewer: computes it again, as fast as it goes, keeps what there is to see, and shows of it what the
/// viewer's Playback asks for, as a session of its own. What is computed can be gone through in both directions.
///
/// Every tick of 300 s and every shape of 100 s are kept; of longer records every second one, and so on.
class ReplayPlayer {
public:
    /// Starts to compute and to show. Throws std::runtime_error for a record that cannot be computed again.
    explicit ReplayPlayer(const std::string& file);
    ~ReplayPlayer();

    /// The session's name, for the viewer.
    const std::string& session() const noexcept;
    render::Playback& playback() noexcept;
    /// Where the tool of another record was. Throws std::runtime_error for one in another body; how finely
    /// the tissue model divided that body does not matter.
    render::Ghost ghostOf(const std::string& file) const;
    /// Shows this moment, as soon as it is computed, and stands there.
    void startAt(double seconds);
    /// Empty, or in words what is wrong: forces are not those of the record.
    std::string problem() const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::apps
