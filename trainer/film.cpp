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
        std::error_code none;
        fs::remove_all(making_, none);
    }
}

void Film::make(const fs::path& programs, const fs::path& record, const std::string& title, const fs::path& log)
{
    const bool can = ::access("/usr/bin/ffmpeg", X_OK) == 0;
    made_ = fs::path(record).replace_extension(can ? ".mp4" : ".pictures");
    making_ = fs::path(made_).replace_extension(".part" + made_.extension().string());
    viewer_.emplace(programs / "palpate-view",
                    std::vector<std::string>{"--replay", record, title, can ? "--movie" : "--offscreen", making_}, log);
}

void Film::take(std::string& told, std::string& notice)
{
    std::error_code failed;
    if (viewer_->failed()) {
        notice = viewer_->message();
        fs::remove_all(making_, failed);
    } else {
        fs::remove_all(made_, failed);
        fs::rename(making_, made_, failed);
        (failed ? notice : told) =
            failed ? made_.string() + ": " + failed.message() : base::said(base::tr("Written to {}"), made_.string());
    }
    viewer_.reset();
}

}  // namespace palpate::trainer
