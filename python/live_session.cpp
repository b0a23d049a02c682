#include <python/live_session.h>

#include <base/error.h>
#include <base/window_size.h>
#include <haptics/broadcast.h>
#include <session/figures.h>
#include <session/open.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <stdexcept>

namespace palpate::python {

LiveUltrasound::LiveUltrasound(const haptics::SessionModel& model)
    : showing_(haptics::showingOf(model, false, haptics::displayGrid(*model.tissue))),
      scanner_(showing_.scenery, showing_.labels, showing_.fine),
      body_(showing_.scenery, showing_.labels),
      examination_(ultrasound::examinationOf(showing_.scenery, scanner_.medium()))
{
}

UltrasoundPicture LiveUltrasound::picture(const haptics::Simulation& simulation, const channel::State& state,
                                          const UltrasoundRequest& request)
{
    const auto [least, most] = std::minmax(request.width, request.height);
    base::failIf(least < 16 || most > base::mostSide, "ultrasound: width and height are 16 to {} pixels", base::mostSide);
    haptics::showShape(simulation, *shape_);
    shape_->tick = state.tick;
    body_.apply(*shape_);
    ultrasound::Settings settings = examination_.settings;
    if (request.depth > 0) {
        const auto depth = static_cast<float>(request.depth);
        base::failIf(depth < examination_.transducer.shallowest || depth > examination_.transducer.deepest,
                     "ultrasound: a depth of {:g} m: the probe has {:g} to {:g} m", request.depth,
                     examination_.transducer.shallowest, examination_.transducer.deepest);
        settings.depth = static_cast<float>(request.depth);
        settings = ultrasound::within(settings, examination_.transducer);
    }
    UltrasoundPicture out;
    out.image.shapeTick = state.tick;
    const auto pose = request.pose ? *request.pose : ultrasound::poseAt(examination_, state);
    scanner_.scan(examination_.transducer, settings, pose, body_, state, out.image);
    converter_.convert(out.image, request.width, request.height, out.pixels);
    const ultrasound::Beam beam(examination_.transducer, settings);
    const ultrasound::Layout layout(beam, request.width, request.height, false, {0, 0});
    out.metresPerPixel = 1.0 / static_cast<double>(layout.pixelsPerMetre());
    out.top = static_cast<double>(beam.top());
    out.pitch = static_cast<double>(beam.pitch());
    return out;
}

namespace {

using Clock = std::chrono::steady_clock;

constexpr auto askEvery = std::chrono::milliseconds(10);
constexpr std::uint64_t flushPeriod = 1024;  // ticks between waits for the recorder's writer

haptics::SessionInfo infoFor(const Modelled& modelled, const std::string& operatorName)
{
    haptics::SessionInfo info = session::describeSession(modelled.model, modelled.info.sceneOrigin, "python");
    info.operatorName = operatorName;
    info.rate = modelled.info.rate;
    return info;
}

}  // namespace

Modelled::Modelled(haptics::SessionModel built, std::string origin) : model(std::move(built))
{
    info = session::describeSession(model, std::move(origin), "python");
}

LiveSession::LiveSession(std::shared_ptr<const Modelled> modelled, const std::string& record,
                         const std::string& operatorName)
    : modelled_(std::move(modelled)), session_(modelled_->model, modelled_->info), recordFile_(record), process_(getpid())
{
    base::failIf(!record.empty() && modelled_->inMemory,
                 "{}: the volume of this session is in memory alone, and its record could not be replayed: save the volume "
                 "(Volume.save) and make the scene of that file",
                 record);
    if (!record.empty()) {
        recorder_ = std::make_unique<haptics::Recorder>(record, infoFor(*modelled_, operatorName));
    }
    last_ = session_.simulation().record();
    const Vec3 line = modelled_->model.approach.aim - modelled_->model.approach.entry;
    if (glm::length(line) > 0) {
        axis_ = glm::normalize(line);
    }
}

LiveSession::~LiveSession()
{
    try {
        close();
    } catch (const std::exception&) {
        // A destructor has nobody to tell; close() does.
    }
}

LiveSession::Use::Use(LiveSession& session, Purpose purpose) : session_(session)
{
    base::failIf(session.busy_.test_and_set(),
                 "the session is at work in another thread: give each thread a session of its own");
    std::string problem;
    if (purpose == Purpose::look) {
        return;
    }
    if (session.closed_) {
        problem = "the session is closed: open another one";
    } else if (session.recorder_ && getpid() != session.process_) {
        problem = session.recordFile_ + ": the session was opened, with its record, in another process: open one here";
    }
    if (!problem.empty()) {
        session.busy_.clear();
        throw std::runtime_error(problem);
    }
}

void LiveSession::heed(const haptics::TickRecord& tick)
{
    for (std::uint32_t i = 0; i < tick.eventCount; ++i) {
        events_.emplace_back(tick.tick, tick.events[i]);
    }
    if (tick.fired) {
        haptics::showTick(tick, {}, cores_, session_.simulation().period());
    }
    last_ = tick;
    axis_ = tick.device.axis;
    ticks_ = tick.tick + 1;
}

channel::State LiveSession::shown() const noexcept
{
    channel::State state = cores_;
    haptics::TickRecord tick = last_;
    tick.fired = false;  // its core is in cores_
    haptics::showTick(tick, {}, state, session_.simulation().period());
    return state;
}

const haptics::TickRecord& LiveSession::step(const haptics::DeviceSample& sample)
{
    const haptics::TickRecord& tick = session_.tick(sample);
    if (recorder_) {
        recorder_->push(tick);
        if (tick.tick % flushPeriod == 0) {
            recorder_->flush();
        }
    }
    heed(tick);
    return last_;
}

bool LiveSession::run(haptics::Device& device, double seconds, const std::function<void(const haptics::TickRecord&)>& each,
                      const std::function<bool()>& keepGoing)
{
    std::atomic<bool> stop{false};
    session::RunOptions options;
    options.servo.paced = false;
    options.servo.seconds = seconds;
    options.recorder = recorder_.get();
    options.stop = &stop;
    auto asked = Clock::now();
    session_.run(device, options, [&](const haptics::TickRecord& tick, const haptics::ServoTiming&) {
        heed(tick);
        if (each) {
            each(tick);
        }
        if (const auto now = Clock::now(); now - asked > askEvery) {
            asked = now;
            stop = !keepGoing();
        }
    });
    return !stop;
}

void LiveSession::close()
{
    const Use alone(*this, Purpose::look);
    if (closed_.exchange(true)) {
        return;
    }
    // In a process that was forked the recorder's thread is not there: the file is its owner's.
    if (recorder_ && getpid() != process_) {
        static_cast<void>(recorder_.release());
    }
    if (!recorder_) {
        return;
    }
    const session::SessionFigures figures = session_.figures();
    recorder_->finish({{"force_hash", session::hexadecimal(figures.forceHash)},
                       {"score_total", fmt::format("{:.1f}", figures.score.total)}});
    const std::string problem = recorder_->error();
    const std::uint64_t lost = recorder_->lost();
    recorder_.reset();
    base::failIf(!problem.empty(), "{}", problem);
    base::failIf(lost > 0, "{}: {} ticks were lost: record to a faster disk", recordFile_, lost);
}

}  // namespace palpate::python
