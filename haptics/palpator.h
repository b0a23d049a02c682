#pragma once

#include <haptics/trainee.h>

#include <array>
#include <vector>

namespace palpate::haptics {

/// A fingertip that looks for a lump by the force alone. It presses over a raster around the planned place, takes force by
/// depth for the stiffness, presses along two lines across the stiffest place, and marks (buttonMark) where on each line
/// the stiffness is half way between the lump's and what is around it: four marks. It sees neither labels nor distances.
///
/// Same seed, same session, bit for bit. In the loop it allocates nothing.
class Palpator final : public Device {
public:
    /// Begins `distance` [m] outside the body on the planned line.
    Palpator(const SessionModel& model, const Skill& skill, std::uint64_t seed, double distance);

    DeviceSample read() noexcept override;
    void write(Vec3 force) noexcept override;
    bool finished() const noexcept override { return stage_ == Stage::done; }

private:
    enum class Stage : std::uint8_t { search, alongU, alongV, mark, done };
    enum class Act : std::uint8_t { travel, press, hold, lift };
    struct Place {
        double u = 0, v = 0;   // across the planned line [m]
        double stiffness = 0;  // as felt [N/m]
    };

    Vec3 at(const Place& place, double depth) const noexcept;
    void begin(Act act) noexcept;
    void step() noexcept;
    void nextPlace() noexcept;
    void nextStage() noexcept;
    void layLine(bool alongU, const Place& through) noexcept;
    void findEdges(bool alongU) noexcept;
    double background() const noexcept;

    Skill skill_;
    Vec3 origin_, axis_, u_, v_;  // planned line and across it
    datasets::Random random_;
    Arm arm_;
    Tremor tremor_;
    Stage stage_ = Stage::search;
    Act act_ = Act::travel;
    double inAct_ = 0, duration_ = 0;  // [s]
    Vec3 from_{0.0}, to_{0.0}, goal_{0.0};
    std::vector<Place> places_;  // of this stage, room for every stage reserved
    std::size_t place_ = 0;
    Place best_;
    double around_ = 0;           // stiffness of what has no lump under it [N/m]
    double touched_ = 0;          // depth at which this press first felt something [m]; below 0: not yet
    double force_ = 0;            // along the planned line, outwards [N]
    std::array<Place, 4> edges_;  // u-, u+, v-, v+
    std::uint64_t ticks_ = 0;
};

}  // namespace palpate::haptics
