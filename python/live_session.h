#pragma once

// A session that Python owns: model, simulation, record, and what happened so far. Knows nothing of Python.

#include <channel/deformation.h>
#include <channel/layout.h>
#include <haptics/device.h>
#include <haptics/recorder.h>
#include <haptics/scenery.h>
#include <haptics/simulation.h>
#include <python/dense_grids.h>
#include <session/session.h>
#include <ultrasound/placement.h>
#include <ultrasound/scanner.h>

#include <sys/types.h>

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace palpate::python {

struct UltrasoundRequest {
    int width = 640, height = 640;         // [pixels]
    std::optional<ultrasound::Pose> pose;  // nothing: where the scene, or else the examination, has the probe
    double depth = 0;                      // of the picture [m]; 0: the probe's own
};

struct UltrasoundPicture {
    ultrasound::BeamImage image;
    ultrasound::Pixels pixels;
    double metresPerPixel = 0;
    double top = 0;    // of the picture's upper border along the probe's axis, below 0 where its face is curved [m]
    double pitch = 0;  // between lines [m], of a curved probe [rad]
};

/// A scanner beside a session.
class LiveUltrasound {
public:
    /// Takes a second or less.
    explicit LiveUltrasound(const haptics::SessionModel& model);

    /// The body as `simulation` has it after its last tick, the tool and the cores as `state` has them: a function of those
    /// and of the request, bit for bit. Throws std::runtime_error for a size that no picture and a depth that no probe has.
    UltrasoundPicture picture(const haptics::Simulation& simulation, const channel::State& state,
                              const UltrasoundRequest& request);

private:
    haptics::Showing showing_;
    ultrasound::Scanner scanner_;
    channel::Deformation body_;
    ultrasound::Examination examination_;
    ultrasound::ScanConverter converter_{ultrasound::Margins{0, 0}};
    std::unique_ptr<channel::Displaced> shape_ = std::make_unique<channel::Displaced>();
};

/// A model that sessions share, and what a record says of it.
struct Modelled {
    Modelled(haptics::SessionModel built, std::string origin);

    haptics::SessionModel model;
    haptics::SessionInfo info;
    std::shared_ptr<const volume::Tissue> given;  // the scene's volume, before gravity; null: not loaded
    bool inMemory = false;                        // its volume is in no file, so that a record could not be replayed
    std::shared_ptr<DenseGrids> dense = std::make_shared<DenseGrids>();  // of model.tissue
};

/// One session. Its methods may be called from any thread, from one at a time.
class LiveSession {
public:
    /// @param record  file for a record; empty: none
    /// @param operatorName  who holds the tool, for the record; may be empty
    /// Throws std::runtime_error, also where the record cannot be made.
    LiveSession(std::shared_ptr<const Modelled> modelled, const std::string& record, const std::string& operatorName);
    ~LiveSession();

    /// What a session is used for: to look at what happened, also after its end, or for more ticks.
    enum class Purpose : std::uint8_t { look, work };

    /// While it lives no other thread can use the session. Throws std::runtime_error when one does; and to work, when the
    /// session is closed, and for one with a record in another process than that which opened it.
    class Use {
    public:
        explicit Use(LiveSession& session, Purpose purpose = Purpose::work);
        ~Use() { session_.busy_.clear(); }
        Use& operator=(Use&&) = delete;

    private:
        LiveSession& session_;
    };

    /// One tick. The session must be in use.
    const haptics::TickRecord& step(const haptics::DeviceSample& sample);
    /// Ticks until the device has finished, the time is over, or `goOn`, which is asked every 10 ms, says false.
    /// @param seconds  at most; 0: no limit
    /// @returns        true when it was not stopped by `goOn`
    bool run(haptics::Device& device, double seconds, const std::function<void(const haptics::TickRecord&)>& each,
             const std::function<bool()>& keepGoing);
    /// Ends the record. Further ticks are errors. Throws std::runtime_error where the record is not whole, and while
    /// another thread uses the session, which then goes on.
    void close();

    const Modelled& modelled() const noexcept { return *modelled_; }
    const std::shared_ptr<const Modelled>& shared() const noexcept { return modelled_; }
    const session::Session& session() const noexcept { return session_; }
    const std::vector<std::pair<std::uint64_t, haptics::Event>>& events() const noexcept { return events_; }
    /// The last tick, or none of them.
    const haptics::TickRecord& last() const noexcept { return last_; }
    /// What a viewer has been shown of the ticks so far, the last included.
    channel::State shown() const noexcept;
    /// These two may be asked for at any time.
    std::uint64_t ticks() const noexcept { return ticks_; }
    bool closed() const noexcept { return closed_; }
    const std::string& recordFile() const noexcept { return recordFile_; }
    /// Of a session that has begun its ticks: that of the last; else that of the planned line.
    Vec3 axis() const noexcept { return axis_; }

private:
    void heed(const haptics::TickRecord& tick);

    std::shared_ptr<const Modelled> modelled_;
    session::Session session_;
    std::unique_ptr<haptics::Recorder> recorder_;
    std::string recordFile_;
    pid_t process_;
    std::atomic_flag busy_;
    std::atomic<bool> closed_ = false;
    std::vector<std::pair<std::uint64_t, haptics::Event>> events_;
    haptics::TickRecord last_;
    channel::State cores_;  // as of the last tick in which the gun was fired
    std::atomic<std::uint64_t> ticks_ = 0;
    Vec3 axis_{0, 1, 0};
};

/// Gives a list of poses to a session, whose forces it does not feel.
class PosesDevice final : public haptics::Device {
public:
    /// The samples must outlive it.
    explicit PosesDevice(std::span<const haptics::DeviceSample> samples) : samples_(samples) {}

    haptics::DeviceSample read() noexcept override { return samples_[next_++]; }
    void write(Vec3) noexcept override {}
    bool finished() const noexcept override { return next_ >= samples_.size(); }

private:
    std::span<const haptics::DeviceSample> samples_;
    std::size_t next_ = 0;
};

}  // namespace palpate::python
