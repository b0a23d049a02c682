#include <datasets/tables.h>
#include <studies/stability/method.h>
#include <studies/validate/experiment.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <memory>

namespace palpate::studies {

namespace {

constexpr double strokeSpeed = 5e-3;     // [m/s]
constexpr double needleRadius = 0.5e-3;  // inner needle of an 18 G set [m]

haptics::SessionModel liverBlock(const LiverLaw& law)
{
    auto table = datasets::defaultTissues();
    auto& liver = table.rows[*table.find("liver")];
    liver.cuttingForce = law.cutting;
    liver.punctureForce = law.cutting;  // the curves show no capsule: the surface was not recorded
    liver.wallSpacing = law.wallSpacing;
    liver.wallForce = law.wallForce;
    liver.relaxingFast = law.relaxation.weights[0];
    liver.relaxingSlow = law.relaxation.weights[1];
    auto scene = datasets::parseScene(
        "name = \"liver\"\n[volume]\nphantom = \"block\"\nvoxel_mm = 2\n[volume.parameters]\ntissue = \"liver\"\ntumours = "
        "0\nwidth_mm = 80\nthickness_mm = 110\n[target]\nstructure = \"base\"\nentry_mm = [0, 0, 0]\naim_mm = [0, 112, "
        "0]\n[dffb]\nmode = \"off\"\n[model]\nlevel = \"chainmail\"\nrelaxation = true\n",
        "liver.toml");
    scene.model.walls = law.wallSpacing > 0.0;
    scene.tool.radius = needleRadius;
    scene.tool.notchRadius = std::min(scene.tool.notchRadius, 0.8 * needleRadius);
    auto tissue = std::make_shared<const volume::Tissue>(datasets::makePhantom(scene.source.phantom, table));
    return haptics::buildModel(std::move(scene), std::move(tissue));
}

// Means of a force over the steps of depth.
class Binned {
public:
    void add(double depth, double force)
    {
        if (depth >= 0.0) {
            const auto bin = static_cast<std::size_t>(depth / strokeStep);
            sum_.resize(std::max(sum_.size(), bin + 1));
            count_.resize(sum_.size());
            sum_[bin] += force;
            count_[bin] += 1.0;
        }
    }
    std::vector<double> means() const
    {
        std::vector<double> out(sum_.size(), NAN);
        for (std::size_t i = 0; i < out.size(); ++i) {
            out[i] = count_[i] > 0.0 ? sum_[i] / count_[i] : NAN;
        }
        return out;
    }

private:
    std::vector<double> sum_, count_;
};

}  // namespace

std::vector<double> rupturesIn(const std::vector<double>& most, const std::vector<double>& least)
{
    std::vector<double> falls;
    for (std::size_t i = 0; i + 2 < most.size(); ++i) {
        const double fall = most[i] - std::min(least[i + 1], least[i + 2]);
        const bool peak = i == 0 || most[i] >= most[i - 1];
        if (peak && most[i] >= most[i + 1] && fall >= minRupture) {
            falls.push_back(fall);
        }
    }
    return falls;
}

LiverLaw fittedWalls(double falls, double size, double length)
{
    LiverLaw law;
    if (falls > 0.0 && size > minRupture) {
        law.wallForce = size - minRupture;
        law.wallSpacing = length / falls * std::exp(-minRupture / law.wallForce);
    }
    return law;
}

NeedleStroke needleStroke(const LiverLaw& liver, glm::dvec2 aside, double depth, const std::vector<double>& heldAt)
{
    const haptics::SessionModel model = liverBlock(liver);
    const auto methods = ourMethods();
    const StabilityMethod& method = *std::ranges::find(methods, datasets::ModelLevel::chainmail, &StabilityMethod::level);
    const MethodScene scene{model, haptics::deviceParameters(model.scene.device)};
    const RunningMethod running = method.start(scene);
    const Vec3 axis(0, 1, 0), entry = model.approach.entry + Vec3(aside.x, 0.0, aside.y);
    const auto force = [&](double at) {
        haptics::DeviceSample sample;
        sample.position = entry + at * axis;
        sample.axis = axis;
        sample.buttons = haptics::buttonDeadMan;
        return -glm::dot(running.tick(sample), axis);
    };
    constexpr double outside = 5e-3;
    for (double t = 0.0; t < haptics::settledAfter; t += scene.period) {
        force(-outside);
    }
    const double step = strokeSpeed * scene.period;
    const auto steps = static_cast<int>(std::ceil((depth + outside) / step));
    Binned inBins, outBins;
    std::vector<double> most, least;  // of the force in each fine step of depth
    double last = 0.0;
    for (int i = 0; i <= steps; ++i) {
        const double at = std::min(-outside + i * step, depth);
        last = force(at);
        inBins.add(at, last);
        if (at >= 0.0) {
            const auto bin = static_cast<std::size_t>(at / fineStep);
            most.resize(std::max(most.size(), bin + 1), last);
            least.resize(most.size(), last);
            most[bin] = std::max(most[bin], last);
            least[bin] = std::min(least[bin], last);
        }
    }
    NeedleStroke out;
    out.falls = rupturesIn(most, least).size();
    double t = 0.0;
    for (const double at : heldAt) {
        for (; t < at - 0.5 * scene.period; t += scene.period) {
            last = force(depth);
        }
        out.held.push_back(last);
    }
    for (int i = 1; i <= steps; ++i) {
        const double at = depth - i * step;
        outBins.add(at, -force(at));
    }
    out.in = inBins.means();
    out.out = outBins.means();
    return out;
}

}  // namespace palpate::studies
