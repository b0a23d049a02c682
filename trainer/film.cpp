#include <trainer/film.h>

#include <base/said.h>
#include <base/words.h>

#include <unistd.h>

#include <system_error>

namespace palpate::trainer {

namespace fs = std::filesystem;

Film::~Film()
{
    if (viewer_) {
        viewer_.reset();
        removeHalf();
    }
}

// Also what the viewer was writing, where it was killed.
void Film::removeHalf() noexcept
{
    std::error_code none;
    fs::remove_all(making_, none);
    fs::remove(making_.string() + ".part", none);
}

void Film::make(const fs::path& programs, const fs::path& record, const std::string& title, const fs::path& log)
{
    const bool can = ::access("/usr/bin/ffmpeg", X_OK) == 0;
    record_ = record;
    made_ = fs::path(record).replace_extension(can ? ".mp4" : ".pictures");
    making_ = fs::path(made_).replace_extension(".part" + made_.extension().string());
    viewer_.emplace(programs / "palpate-view",
                    std::vector<std::string>{"--replay", record, title, can ? "--movie" : "--offscreen", making_}, log);
}

void Film::take(std::string& told, std::string& notice)
{
    std::error_code failed, none;
    if (viewer_->failed()) {
        notice = viewer_->message();
        removeHalf();
    } else {
        fs::remove_all(made_, failed);
        fs::rename(making_, made_, failed);
        (failed ? notice : told) =
            failed ? made_.string() + ": " + failed.message() : base::said(base::tr("Written to {}"), made_.string());
    }
    if (!fs::exists(record_, none)) {
        removeHalf();
        fs::remove_all(made_, none);
        told.clear();
        notice = base::tr("The record of this film is no longer there: no film of it is kept.");
    }
    viewer_.reset();
}

}  // namespace palpate::trainer
