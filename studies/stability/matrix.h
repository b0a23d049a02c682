#pragma once

#include <studies/stability/method.h>
#include <studies/stability/scene.h>

#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace palpate::studies {

/// A session in a scene, tick by tick.
struct Trace {
    double period = 1e-3;        // [s]
    double cap = 0;              // of the force [N]
    double encoder = 0;          // step of the device's encoder [m]
    double stiffest = 0;         // that the device may be made to feel: haptics::stableLimits() [N/m]
    double handSpring = 0;       // sqrt(stiffness x moving mass) of hand and device [N s/m]; 0 without a hand
    double residue = 0;          // of the tissue at the end [m]
    std::vector<Vec3> position;  // true, of the tool at each tick [m]
    std::vector<double> speed;   // true [m/s]
    std::vector<double> work;    // of the motors on device and hand so far [J]
    std::vector<Vec3> force;     // sent at that tick and held for a period [N]
    std::vector<Vec3> tissue;    // before a controller, where there is one: else the same [N]

    double time(std::size_t tick) const noexcept { return static_cast<double>(tick) * period; }
};

/// A figure of a trace, in its unit; not finite where a force was not.
double figureOf(Figure figure, const Trace& trace, const StabilityScene& scene);

/// One session: a method in a scene, with a device, a hand and a rate.
struct Cell {
    std::string scene, method, device;
    bool held = true;  // the hand holds on; false: it lets go
    int rate = 1000;   // of the force loop [Hz]

    std::string grip() const { return held ? "grip" : "released"; }
    /// "slide-30deg-20mm_s/elastic/touch/grip/1000"
    std::string id() const;
};

struct CellResult {
    Cell cell;
    Bounded bounded;
    double figure = 0;  // in the figure's unit
    /// Not a number fails; what is at the bound but for rounding passes.
    bool pass() const noexcept { return figure <= bounded.bound * (1.0 + 1e-9); }
};

/// What a matrix is made of. Empty lists: all there is.
struct MatrixChoice {
    std::vector<std::string> scenes, methods, devices;
    std::vector<int> rates{500, 1000, 4000};
    bool quick = false;  // the short matrix: some scenes, one device, 1 kHz; only what is not chosen otherwise
};

/// Models of the scenes, made once and shared by all cells.
class StabilityModels {
public:
    StabilityModels();
    StabilityModels& operator=(StabilityModels&&) = delete;

    /// Scenes beside those of the matrix: found by name, and in no list. Those that are there already are left out.
    void add(std::vector<StabilityScene> scenes);
    /// Makes the models that these cells run on, in parallel.
    void prepare(const std::vector<Cell>& cells);
    /// Throws std::runtime_error for a name that there is none of, with those that there are.
    const StabilityScene& scene(const std::string& name) const;
    const StabilityMethod& method(const std::string& name) const;
    /// A prepared model.
    const haptics::SessionModel& model(const StabilityScene& scene, datasets::ModelLevel level) const;

    const std::vector<StabilityScene>& scenes() const noexcept { return scenes_; }
    const std::vector<StabilityMethod>& methods() const noexcept { return methods_; }

private:
    using Key = std::pair<std::string, datasets::ModelLevel>;  // body and tool, level
    static std::string bodyOf(const StabilityScene& scene);

    std::vector<StabilityScene> scenes_, others_;
    std::vector<StabilityMethod> methods_;
    std::map<Key, std::unique_ptr<const haptics::SessionModel>> models_;
};

/// All cells of a choice, by scene, method, device, grip and rate. Throws std::runtime_error for a name that there is none
/// of.
std::vector<Cell> matrixCells(const StabilityModels& models, const MatrixChoice& choice);

/// The cell of an id. Throws std::runtime_error for one that is none.
Cell cellOf(const StabilityModels& models, const std::string& id);

/// Called after every tick of a session: sample, force, and the method.
using TickVisit = std::function<void(const haptics::DeviceSample&, Vec3, const RunningMethod&)>;

/// Runs one session in simulated time. The same cell gives the same bits, on any thread.
Trace runSession(const Cell& cell, const StabilityScene& scene, const StabilityMethod& method,
                 const haptics::SessionModel& model, const TickVisit& visit = {});
CellResult runCell(const Cell& cell, const StabilityModels& models);

/// Runs `work(i)` for i = 0 .. count - 1 on `jobs` threads, and `told(done)` on the calling one now and then. Passes on
/// the first exception.
void onThreads(std::size_t count, int jobs, const std::function<void(std::size_t)>& work,
               const std::function<void(std::size_t)>& told);

}  // namespace palpate::studies
