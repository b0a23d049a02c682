#include <trainer/window.h>

#include <base/end_in_order.h>
#include <base/quantiles.h>
#include <base/user_files.h>
#include <base/words.h>
#include <trainer/errands.h>
#include <trainer/example.h>
#include <trainer/stage.h>

#include <algorithm>
#include <deque>
#include <iterator>
#include <utility>

namespace palpate::trainer {

namespace {

constexpr double idle = 0.2;           // between looks at what runs, when nobody does anything [s]
constexpr double betweenLooks = 0.03;  // for buttons of a device, where there is one [s]

ScreenFigures figuresOf(std::string screen, const std::vector<double>& seconds)
{
    const auto at = [&](double fraction) { return base::lowerQuantile(seconds, fraction); };
    return {std::move(screen), seconds.size(), at(0.5), at(0.9), at(1)};
}

// Cases, people and settings as they are.
State stateOf(const WindowOptions& options, Errands& errands)
{
    State state;
    state.settings = readSettings(base::trainerSettings());
    base::useLanguage(state.settings.language);
    state.settings.textScale = options.textScale > 0 ? options.textScale : state.settings.textScale;
    errands.list(state);
    for (std::size_t i = 0; i < state.cases.size(); ++i) {
        state.chosen = state.cases[i].id == options.caseId ? i : state.chosen;
    }
    return state;
}

// Presses at a device's grip, one for every second picture: a key has to come up before it goes down again.
class Presses {
public:
    Presses(Stage& stage, Errands& errands) : stage_(stage), errands_(errands) {}

    /// Waits until something happens. Returns whether something was done to the window.
    bool await(const State& state)
    {
        bool happened = false;
        for (double left = idle; !happened && left > 0 && waiting_.empty();) {
            const double slice = state.gripReady ? std::min(betweenLooks, left) : left;
            happened = stage_.await(slice);
            left -= slice;
            take();
        }
        return happened;
    }
    /// Before a picture. Returns whether one more is needed.
    bool work(const State& state)
    {
        take();
        if (!listensToGrip(state)) {
            waiting_.clear();
        }
        down_ = !down_ && !waiting_.empty();
        if (down_) {
            stage_.press(waiting_.front());
            waiting_.pop_front();
        }
        return down_ || !waiting_.empty();
    }

private:
    void take() { std::ranges::copy(errands_.pressed(), std::back_inserter(waiting_)); }

    Stage& stage_;
    Errands& errands_;
    std::deque<Press> waiting_;
    bool down_ = false;
};

}  // namespace

WindowFigures runWindow(const WindowOptions& options, ResultSink& sink)
{
    Stage stage(options.width, options.height);
    Errands errands(options.programs, sink);
    State state = stateOf(options, errands);
    Presses presses(stage, errands);
    std::vector<double> seconds;
    // A press and its release are two pictures, even of one look; what they open is there after two more.
    constexpr int settling = 4;
    int due = settling;  // pictures until all has settled
    while (!base::EndInOrder::asked() && (options.frames == 0 || seconds.size() < options.frames)) {
        if (stage.closed() && leave(state) == Errand::quit) {
            break;
        }
        stage.stay();
        bool news = options.frames == 0 && due == 0 ? presses.await(state) : stage.await(0);
        const bool wasRunning = state.running;
        // Buttons work what keys work: the window that has the focus.
        state.listening = options.frames == 0 && stage.focused();
        news = errands.look(state) || news;
        if (wasRunning && !state.running) {
            stage.takeFocus();  // from the session's window, which is gone
        }
        const bool pressed = presses.work(state);
        due = news || pressed ? settling : due;
        if (options.frames == 0 && due == 0) {
            continue;
        }
        const Drawn drawn = stage.draw(state);
        seconds.push_back(drawn.seconds);
        due = drawn.unsettled || pressed || drawn.errand != Errand::none ? settling : due - 1;
        if (drawn.errand == Errand::quit) {
            break;
        }
        errands.run(drawn.errand, state);
        if (drawn.errand == Errand::keepSettings) {
            stage.renew();
        }
    }
    return {stage.renderer(), figuresOf({}, seconds), {}};
}

WindowFigures measureScreens(const WindowOptions& options, ResultSink& sink)
{
    Stage stage(options.width, options.height);
    Errands errands(options.programs, sink);
    const State listed = stateOf(options, errands);
    WindowFigures figures{stage.renderer(), {}, {}};
    std::vector<double> all;
    for (auto& [name, state] : exampleScreens(listed)) {
        // The first one loads pictures.
        stage.renew();
        stage.draw(state);
        std::vector<double> seconds;
        while (seconds.size() < options.frames && !stage.closed()) {
            stage.await(0);
            seconds.push_back(stage.draw(state).seconds);
        }
        all.insert(all.end(), seconds.begin(), seconds.end());
        figures.screens.push_back(figuresOf(name, seconds));
    }
    figures.all = figuresOf({}, all);
    return figures;
}

}  // namespace palpate::trainer
