#include <render/follower.h>

#include <base/error.h>
#include <base/quantiles.h>
#include <base/said.h>
#include <render/result_file.h>

#include <glm/geometric.hpp>

#include <ctime>

#include <algorithm>
#include <utility>

namespace palpate::render {
namespace {

using base::lowerQuantile;
using base::said;
using base::tr;

double seconds(Clock::duration d)
{
    return std::chrono::duration<double>(d).count();
}

// The clock that State::published is in [s].
double monotonic()
{
    timespec t{};
    ::clock_gettime(CLOCK_MONOTONIC, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double publishedAt(const channel::State& state)
{
    return 1e-9 * static_cast<double>(state.published);
}

constexpr double still = 0.05e-3;  // [m]: what moves less need not be followed at speed

bool differ(const channel::Displaced& now, const std::vector<channel::Displacement>& before)
{
    const auto same = [](const channel::Displacement& a, const channel::Displacement& b) {
        const glm::dvec3 way(a.u[0] - b.u[0], a.u[1] - b.u[1], a.u[2] - b.u[2]);
        return a.node == b.node && glm::length(way) < still;
    };
    return !std::equal(now.nodes.begin(), now.nodes.begin() + now.count, before.begin(), before.end(), same);
}

std::string onlySession(const std::vector<std::string>& running)
{
    if (running.empty())
        return {};
    if (running.size() == 1)
        return running.front();
    std::string all;
    for (const std::string& name : running)
        all += (all.empty() ? "" : ", ") + name;
    throw base::error("several sessions are running ({}): choose one with --session NAME", all);
}

}  // namespace

Follower::Follower(std::string session, double wait, std::filesystem::path result)
    : wanted_(std::move(session)), wait_(wait), result_(std::move(result))
{
}

bool Follower::over() const noexcept
{
    constexpr double toRead = 300;  // a result [s]
    const double wait = resultShown_ ? std::max(wait_, toRead) : wait_;
    return !subscriber_ && ending_ == channel::Ending::finished && seconds(Clock::now() - since_) > wait;
}

bool Follower::moving() const noexcept
{
    constexpr double settled = 1.2;  // [s]: longer than a hand pauses, for a fine picture is slow to leave
    return subscriber_ && seconds(Clock::now() - moved_) < settled;
}

void Follower::tryAttach(Picture& picture)
{
    constexpr double again = 0.1;  // [s]
    if (seconds(Clock::now() - checked_) < again)
        return;
    checked_ = Clock::now();
    const std::string name = wanted_.empty() ? onlySession(channel::sessions()) : wanted_;
    if (name.empty())
        return;
    auto found = channel::Subscriber::attach(name);
    if (!found || !found->alive())
        return;
    subscriber_ = std::move(found);
    resultShown_ = false;
    ++attached_;
    silent_ = false;
    name_ = wanted_ = name;
    pid_ = subscriber_->ownerPid();
    ending_ = channel::Ending::none;
    displaced_->publication = 0;
    reshaped_ = false;
    known_ = false;
    state_ = {};
    health_ = {};
    structures_ = subscriber_->scenery().structure;
    picture.open(subscriber_->scenery(), subscriber_->labels(), name, subscriber_->image(), subscriber_->fine());
    picture.setNotice("", "");
}

void Follower::read()
{
    const auto now = subscriber_->state();
    if (!now)
        return;
    if (known_ && now->tick == state_.tick) {
        state_.published = now->published;  // a record or a session that is paused
        state_.standing = now->standing;
        health_.delay = 0;  // behind nothing
        return;
    }
    if (!known_ || now->tick < rateFrom_.tick)
        rateFrom_ = *now;
    constexpr double rateOver = 0.5;  // [s]
    if (const double span = publishedAt(*now) - publishedAt(rateFrom_); span > rateOver) {
        health_.tickRate = static_cast<double>(now->tick - rateFrom_.tick) / span;
        rateFrom_ = *now;
    }
    if (!known_ || glm::distance(vec(now->tip), restingTip_) > still) {
        restingTip_ = vec(now->tip);
        moved_ = polled_;
    }
    state_ = *now;
    read_ = monotonic();
    known_ = fresh_ = true;
}

void Follower::readShape()
{
    if (!subscriber_->displaced(*displaced_))
        return;
    reshaped_ = true;
    if (differ(*displaced_, displacedBefore_)) {
        moved_ = polled_;
        displacedBefore_.assign(displaced_->nodes.begin(), displaced_->nodes.begin() + displaced_->count);
    }
}

// A simulation that is stopped (SIGSTOP, a debugger) lives and publishes nothing.
void Follower::notice(Picture& picture)
{
    constexpr double longest = 1.0;  // [s]
    const bool silent = known_ && monotonic() - publishedAt(state_) > longest;
    if (silent != std::exchange(silent_, silent))
        picture.setNotice(silent ? tr("no answer from the simulation") : "", silent ? tr("the picture is as it was") : "");
}

void Follower::leave(Picture& picture)
{
    const bool finished = ending_ == channel::Ending::finished;
    picture.setNotice(finished                           ? tr("simulation ended")
                      : ending_ == channel::Ending::torn ? tr("shared memory was cut off")
                                                         : tr("simulation stopped without ending"),
                      said(tr("closes in {:.0f} s unless session {} starts again"), wait_, name_));
    readShape();
    subscriber_.reset();
    since_ = Clock::now();
}

void Follower::lookForResult(Picture& picture)
{
    if (resultShown_ || result_.empty() || ending_ != channel::Ending::finished)
        return;
    if (auto card = readResult(result_)) {
        resultShown_ = true;
        picture.setResult(std::move(*card));
        picture.setNotice(tr("session ended"), tr("Q closes the window"));
    }
}

void Follower::giveUp() const
{
    base::failIf(ending_ == channel::Ending::torn, "session {}: its shared memory was cut off by another program", name_);
    base::failIf(ending_ == channel::Ending::killed, "session {} stopped without ending (process {} is gone)", name_, pid_);
    base::failIf(ending_ == channel::Ending::none, "no session {}within {:g} s: start one with palpate train{}",
                 wanted_.empty() ? "" : wanted_ + " ", wait_, wanted_.empty() ? "" : " --session " + wanted_);
}

void Follower::poll(Picture& picture)
{
    polled_ = Clock::now();
    if (!subscriber_) {
        if (ending_ == channel::Ending::none)
            picture.setNotice(wanted_.empty() ? tr("waiting for a session") : said(tr("waiting for session {}"), wanted_),
                              tr("palpate train starts one"));
        tryAttach(picture);
    }
    if (!subscriber_) {
        lookForResult(picture);
        if (seconds(polled_ - since_) > wait_)
            giveUp();
        return;
    }
    // The way it ended first, the last state after it: so that the last state is the last.
    constexpr double again = 0.02;  // [s]: it asks the system
    if (seconds(polled_ - checked_) > again) {
        checked_ = polled_;
        ending_ = subscriber_->ending();
    }
    read();
    if (known_)
        picture.note(state_);
    notice(picture);
    if (ending_ != channel::Ending::none)
        leave(picture);
}

void Follower::draw(Picture& picture, Quality quality, const std::function<void()>& present)
{
    if (subscriber_)
        readShape();
    if (known_)
        picture.update(state_, std::exchange(reshaped_, false) ? displaced_.get() : nullptr, health_);
    picture.render(quality);
    if (present)
        present();
    picture.finish(polled_);
    const auto now = Clock::now();
    if (!known_)
        return;
    if (fresh_) {
        const double delay = monotonic() - publishedAt(state_);
        frameSeconds_.push_back(seconds(now - polled_));
        shown_.push_back({state_.tick, publishedAt(state_), read_, monotonic()});
        health_.delay = delay;
        fresh_ = false;
    }
    // Pictures of what stands still are slow on purpose.
    const bool flowing = std::exchange(flowing_, quality == Quality::moving) && flowing_;
    if (first_ && flowing) {
        const double rate = 1 / std::max(seconds(now - last_), 1e-6);
        constexpr double keep = 0.9;
        health_.framesPerSecond = health_.framesPerSecond > 0 ? keep * health_.framesPerSecond + (1 - keep) * rate : rate;
    }
    if (!first_)
        first_ = now;
    last_ = now;
    ++frames_;
}

ViewerFigures Follower::figures() const
{
    ViewerFigures figures;
    figures.frames = frames_;
    figures.frameP50 = lowerQuantile(frameSeconds_, 0.5);
    figures.frameP90 = lowerQuantile(frameSeconds_, 0.9);
    std::vector<double> delays;
    for (const Shown& picture : shown_)
        delays.push_back(picture.done - picture.published);
    figures.delayP50 = lowerQuantile(delays, 0.5);
    figures.delayP99 = lowerQuantile(std::move(delays), 0.99);
    figures.shown = shown_;
    const double span = first_ ? seconds(last_ - *first_) : 0;
    figures.rate = span > 0 ? static_cast<double>(frames_ - 1) / span : 0;
    return figures;
}

void addScans(const UltrasoundPicture& ultrasound, ViewerFigures& figures)
{
    const auto scans = ultrasound.figures();
    if (!scans || scans->seconds.empty())
        return;
    figures.scans = scans->seconds.size();
    figures.scanP50 = lowerQuantile(scans->seconds, 0.5);
    figures.scanP90 = lowerQuantile(scans->seconds, 0.9);
    figures.firstScan = scans->first;
    for (std::size_t i = 0; i < ultrasound::stageCount; ++i)
        figures.scanStages.emplace_back(ultrasound::stageNames[i], scans->stages[i] / static_cast<double>(figures.scans));
}

}  // namespace palpate::render
