#pragma once

#include <channel/layout.h>
#include <ultrasound/display.h>
#include <ultrasound/placement.h>
#include <ultrasound/scanner.h>

#include <array>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <thread>
#include <utility>
#include <vector>

namespace palpate::render {

/// A moment that a stage took [s], over all pictures.
struct ScanFigures {
    std::vector<double> seconds;                          // of each picture, CPU time
    std::array<double, ultrasound::stageCount> stages{};  // sums
    double first = 0;                                     // of the first picture, with the medium
};

/// An ultrasound scanner in a thread of its own: it is told what there is to see and gives pictures; the newest request
/// counts, and those that were not begun are dropped.
class ScanThread {
public:
    using Image = std::shared_ptr<const ultrasound::BeamImage>;

    /// Copies what it is given.
    ScanThread(const channel::Scenery& scenery, std::span<const std::uint8_t> labels, std::span<const std::uint8_t> fine);
    ~ScanThread();

    /// What there is to see now. `shape`: null when it is as before.
    void show(const channel::State& state, const channel::Displaced* shape);
    /// What is asked of the scanner from now on; another shape of probe is laid on the skin anew.
    void ask(const ultrasound::Transducer& transducer, const ultrasound::Settings& settings);
    /// Moves the probe on the skin, where no hand of the session holds it; see ultrasound::movedOnSkin().
    void move(const ultrasound::ProbeMove& move);
    /// How the session's examination begins; nothing until the body is read.
    std::optional<ultrasound::Examination> beginning() const;
    /// The newest picture; null until there is one.
    Image latest() const;
    /// Waits until the newest request is a picture.
    void await() const;
    /// The last pictures, oldest first.
    std::deque<Image> cine() const;
    ScanFigures figures() const;

private:
    struct Request {
        channel::State state;
        std::vector<channel::Displacement> shape;
        std::uint64_t shapeTick = 0;
        std::uint64_t number = 0;
    };

    // Changes what is wanted, and wakes the thread.
    template <typename How>
    void change(const How& how);
    void run();
    void follow(const ultrasound::Scanner& scanner, ultrasound::Examination& e);
    void add(Image image, std::uint64_t number, double seconds, const std::array<double, ultrasound::stageCount>& stages);

    channel::Scenery scenery_;
    std::vector<std::uint8_t> labels_, fine_;

    mutable std::mutex guard_;
    mutable std::condition_variable changed_;
    Request wanted_;          // under guard_, as all below
    std::uint64_t done_ = 0;  // number of the last request that is a picture
    bool known_ = false;      // a state has come
    bool stop_ = false;
    std::optional<ultrasound::Examination> beginning_;
    std::optional<std::pair<ultrasound::Transducer, ultrasound::Settings>> asked_;
    ultrasound::ProbeMove move_;  // since the last picture
    std::deque<Image> images_;
    ScanFigures figures_;
    std::thread thread_;
};

}  // namespace palpate::render
