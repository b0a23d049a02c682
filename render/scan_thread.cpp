#include <render/scan_thread.h>

#include <base/processor_time.h>

#include <algorithm>

namespace palpate::render {
constexpr std::size_t cineLength = 150;  // pictures: five seconds

ScanThread::ScanThread(const channel::Scenery& scenery, std::span<const std::uint8_t> labels,
                       std::span<const std::uint8_t> fine)
    : scenery_(scenery), labels_(labels.begin(), labels.end()), fine_(fine.begin(), fine.end()), thread_([this] { run(); })
{
}

template <typename How>
void ScanThread::change(const How& how)
{
    {
        const std::lock_guard lock(guard_);
        how();
        ++wanted_.number;
    }
    changed_.notify_all();
}

ScanThread::~ScanThread()
{
    change([&] { stop_ = true; });
    thread_.join();
}

void ScanThread::show(const channel::State& state, const channel::Displaced* shape)
{
    change([&] {
        wanted_.state = state;
        if (shape != nullptr) {
            wanted_.shape.assign(shape->nodes.begin(), shape->nodes.begin() + shape->count);
            wanted_.shapeTick = shape->tick;
        }
        known_ = true;
    });
}

void ScanThread::ask(const ultrasound::Transducer& transducer, const ultrasound::Settings& settings)
{
    change([&] { asked_ = {transducer, settings}; });
}

void ScanThread::move(const ultrasound::ProbeMove& move)
{
    change([&] { move_ += move; });
}

std::optional<ultrasound::Examination> ScanThread::beginning() const
{
    const std::lock_guard lock(guard_);
    return beginning_;
}

ScanThread::Image ScanThread::latest() const
{
    const std::lock_guard lock(guard_);
    return images_.empty() ? nullptr : images_.back();
}

void ScanThread::await() const
{
    std::unique_lock lock(guard_);
    changed_.wait(lock, [this] { return stop_ || !known_ || done_ == wanted_.number; });
}

std::deque<ScanThread::Image> ScanThread::cine() const
{
    const std::lock_guard lock(guard_);
    return images_;
}

ScanFigures ScanThread::figures() const
{
    const std::lock_guard lock(guard_);
    return figures_;
}

// Takes what is asked over into `e`.
void ScanThread::follow(const ultrasound::Scanner& scanner, ultrasound::Examination& e)
{
    const auto asked = std::exchange(asked_, std::nullopt);
    const ultrasound::ProbeMove move = std::exchange(move_, {});
    const bool other = asked && asked->first.shape != e.transducer.shape;
    if (asked) {
        e.transducer = asked->first;
        e.settings = ultrasound::within(asked->second, e.transducer);
    }
    if (!e.held && (other || move != ultrasound::ProbeMove{}))
        e.pose = ultrasound::movedOnSkin(scanner.medium(), e, move);
}

void ScanThread::run()
{
    double began = base::processorTime();
    channel::Deformation body(scenery_, labels_);
    ultrasound::Scanner scanner(scenery_, labels_, fine_);
    ultrasound::Examination examination = ultrasound::examinationOf(scenery_, scanner.medium());
    std::unique_lock lock(guard_);
    beginning_ = examination;
    const auto shape = std::make_unique<channel::Displaced>();
    std::uint64_t shaped = ~std::uint64_t{0};
    while (true) {
        changed_.wait(lock, [this] { return stop_ || (known_ && done_ != wanted_.number); });
        if (stop_)
            return;
        const Request request = wanted_;
        follow(scanner, examination);
        lock.unlock();
        if (std::exchange(shaped, request.shapeTick) != request.shapeTick) {
            std::copy(request.shape.begin(), request.shape.end(), shape->nodes.begin());
            shape->count = static_cast<std::uint32_t>(request.shape.size());
            body.apply(*shape);
        }
        const auto image = std::make_shared<ultrasound::BeamImage>();
        image->shapeTick = request.shapeTick;
        scanner.scan(examination.transducer, examination.settings, ultrasound::poseAt(examination, request.state), body,
                     request.state, *image);
        const double now = base::processorTime();
        lock.lock();
        add(image, request.number, now - std::exchange(began, now), scanner.seconds());
    }
}

void ScanThread::add(Image image, std::uint64_t number, double seconds,
                     const std::array<double, ultrasound::stageCount>& stages)
{
    if (done_ == 0) {
        figures_.first = seconds;
    } else {
        figures_.seconds.push_back(seconds);
        for (std::size_t i = 0; i < stages.size(); ++i)
            figures_.stages[i] += stages[i];
    }
    images_.push_back(std::move(image));
    if (images_.size() > cineLength)
        images_.pop_front();
    done_ = number;
    changed_.notify_all();
}

}  // namespace palpate::render
