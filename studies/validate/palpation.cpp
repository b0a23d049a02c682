#include <studies/validate/experiment.h>

#include <base/error.h>
#include <base/rank_correlation.h>
#include <haptics/session_model.h>
#include <studies/press/press.h>
#include <studies/validate/measurements.h>

#include <fmt/format.h>
#include <boost/math/distributions/normal.hpp>

#include <algorithm>
#include <array>

namespace palpate::studies {

namespace {

constexpr double justNoticeable = 0.07;                        // of a force (Jones 1989)
constexpr double fingerRadius = 6e-3, fingerLength = 30e-3;    // [m]
constexpr double pressedDepth = 6e-3, pressSpeed = 30e-3;      // [m], [m/s]
constexpr std::array<double, 3> diameters{3e-3, 5e-3, 10e-3};  // [m]
constexpr std::array<double, 3> moduli{6.4e3, 16.4e3, 42.5e3};
constexpr std::array<double, 2> depths{5e-3, 12e-3};

// Lumps of which a share was detected: all, or those of one size or hardness.
struct Group {
    const char* id;    // row of the facts
    const char* what;  // as it says
    double diameter;   // [m]; 0: of all sizes
    double modulus;    // [Pa]; 0: of all
};
constexpr std::array<Group, 7> groups{{{"f1", "all lumps", 0.0, 0.0},
                                       {"f2", "10 mm", 10e-3, 0.0},
                                       {"f3", "3 mm", 3e-3, 0.0},
                                       {"f4", "hard", 0.0, 42.5e3},
                                       {"f5", "soft", 0.0, 6.4e3},
                                       {"f7", "10 mm hard", 10e-3, 42.5e3},
                                       {"f8", "3 mm soft", 3e-3, 6.4e3}}};

// z of a fraction of a normal distribution.
double normalScore(double fraction)
{
    constexpr double least = 1e-12;
    return boost::math::quantile(boost::math::normal(), std::clamp(fraction, least, 1.0 - least));
}

double factOf(const Measurements& facts, const std::string& id, const std::filesystem::path& file)
{
    for (std::size_t row = 0; row < facts.rows(); ++row) {
        if (facts.text(row, "id") == id) {
            return facts.number(row, "value");
        }
    }
    throw base::error("{}: has no fact '{}'", file.string(), id);
}

}  // namespace

double forceOver(const Lump& lump)
{
    auto scene = datasets::parseScene(
        fmt::format("name = \"lump\"\ntask = \"find\"\n[volume]\nphantom = \"block\"\nvoxel_mm = 1\n[volume.parameters]\n"
                    "tumours = 0\nthickness_mm = 40\nwidth_mm = 64\n[[insert]]\nname = \"lump\"\ndiameter_mm = {:g}\n"
                    "centre_mm = [0, {:g}, 0]\ntissue = \"{}\"\n[tool]\nkind = \"capsule\"\nradius_mm = {:g}\nlength_mm = "
                    "{:g}\n[dffb]\n"
                    "mode = \"off\"\n[target]\nstructure = \"lump\"\nentry_mm = [0, 0, 0]\naim_mm = [0, {:g}, 0]\n"
                    "[tissue.idc_high_grade]\nyoungs_kpa = {:g}\n",
                    1e3 * lump.diameter, 1e3 * (lump.depth + 0.5 * lump.diameter),
                    lump.youngsModulus > 0.0 ? "idc_high_grade" : "fat", 1e3 * fingerRadius, 1e3 * fingerLength,
                    1e3 * (lump.depth + 0.5 * lump.diameter),
                    1e-3 * (lump.youngsModulus > 0.0 ? lump.youngsModulus : moduli.front())),
        "lump.toml");
    const haptics::SessionModel model = haptics::buildModel(std::move(scene));
    constexpr double gap = 0.5e-3;
    constexpr double hold = 0.1;
    PosePath path{"palpation", {}};
    const double in = (pressedDepth + gap) / pressSpeed;
    path.poses = {{Vec3(0, -fingerRadius - gap, 0), Vec3(0, 1, 0), 0.0},
                  {Vec3(0, pressedDepth - fingerRadius, 0), Vec3(0, 1, 0), in},
                  {Vec3(0, pressedDepth - fingerRadius, 0), Vec3(0, 1, 0), in + hold}};
    PressOptions options;
    options.tool = model.scene.tool;
    options.every = path.ticks();
    double force = 0.0;
    press(model, path, {}, options, [&](const PressSample& s) { force = -s.force.y; });
    return force;
}

Experiment palpationOrder(const std::filesystem::path& file, const ValidateProgress& progress)
{
    const Measurements facts(file);
    Experiment e;
    e.name = "palpation";
    e.quantity = "order of lumps by detection and by contrast of force: 1 less Spearman's rank correlation, 7 groups";
    e.source =
        "Fletcher, O'Malley, Bunce 1985, JAMA 253:2224: 80 physicians, silicone breasts with lumps; moduli and depths are "
        "not given";
    e.fittedOn = "nothing: lumps of 6.4, 16.4 and 42.5 kPa in fat of 3.25 kPa, 5 and 12 mm deep";
    e.predicted = "mean contrast of the force of a fingertip 6 mm deep, of each group of lumps";
    e.bound = 10.0;
    progress("palpation: without a lump");
    const double none = forceOver({diameters.back(), 0.0, depths.front()});
    struct Felt {
        Lump lump;
        double contrast;
    };
    std::vector<Felt> felt;
    for (const double diameter : diameters) {
        for (const double modulus : moduli) {
            for (const double depth : depths) {
                progress(fmt::format("palpation: lump {} of 18", felt.size() + 1));
                const Lump lump{diameter, modulus, depth};
                felt.push_back({lump, forceOver(lump) / none - 1.0});
                e.parameters.emplace_back(
                    fmt::format("contrast_pct_{:g}mm_{:g}kpa_{:g}mm_deep", 1e3 * diameter, 1e-3 * modulus, 1e3 * depth),
                    1e2 * felt.back().contrast);
            }
        }
    }
    std::vector<double> detected, contrast;
    e.picture = {"Lumps: detected by people, and contrast of force",
                 "mean contrast, in just noticeable differences (7 %)",
                 "share detected [-]",
                 {}};
    for (const Group& g : groups) {
        double sum = 0.0;
        int count = 0;
        for (const Felt& f : felt) {
            const bool in = (g.diameter == 0.0 || f.lump.diameter == g.diameter) &&
                            (g.modulus == 0.0 || f.lump.youngsModulus == g.modulus);
            sum += in ? f.contrast / justNoticeable : 0.0;
            count += in ? 1 : 0;
        }
        detected.push_back(factOf(facts, g.id, file));
        contrast.push_back(sum / count);
        e.picture.curves.push_back({g.what, {contrast.back()}, {detected.back()}, false});
    }
    const double correlation = base::rankCorrelation(detected, contrast);
    e.error = e.worst = 1e2 * (1.0 - correlation);
    const double slope = normalScore(detected[1]) - normalScore(detected[2]);
    e.parameters.emplace_back("rank_correlation", correlation);
    e.parameters.emplace_back("z_10mm_less_3mm", slope);
    e.parameters.emplace_back("contrast_10mm_less_3mm_jnd", contrast[1] - contrast[2]);
    e.note = fmt::format(
        "rank correlation {:.2f}; from 3 to 10 mm people gain {:.1f} in z, the contrast {:.1f} just noticeable "
        "differences: the order counts, thresholds do not",
        correlation, slope, contrast[1] - contrast[2]);
    e.judge();
    return e;
}

}  // namespace palpate::studies
