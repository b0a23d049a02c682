#include <volume/table_check.h>

#include <base/error.h>
#include <volume/law.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace palpate::volume {

namespace {

struct Number {
    const char* name;
    double value;
    double low = 0, high = std::numeric_limits<double>::max();  // both may be taken
};

void checkNumbers(const std::string& table, const TissueRow& row)
{
    constexpr double most = std::numeric_limits<double>::max();
    const Acoustics& a = row.acoustics;
    const std::array numbers{Number{"density", row.density},
                             Number{"shortest link", row.compress},
                             Number{"longest link", row.stretch},
                             Number{"shear of a link", row.shear},
                             Number{"force of puncture", row.punctureForce},
                             Number{"force of cutting", row.cuttingForce},
                             Number{"friction of a shaft", row.frictionPerMetre},
                             Number{"stiction of a shaft", row.stictionPerMetre},
                             Number{"damping of a shaft", row.frictionDamping},
                             Number{"fast relaxation", row.relaxingFast, 0, 1},
                             Number{"slow relaxation", row.relaxingSlow, 0, 1 - row.relaxingFast},
                             Number{"distance of walls", row.wallSpacing},
                             Number{"force of walls", row.wallForce},
                             Number{"opacity", static_cast<double>(row.opacity), 0, 1},
                             Number{"red", static_cast<double>(row.colour.r), 0, 1},
                             Number{"green", static_cast<double>(row.colour.g), 0, 1},
                             Number{"blue", static_cast<double>(row.colour.b), 0, 1},
                             Number{"speed of sound", a.soundSpeed},
                             Number{"attenuation", a.attenuation},
                             Number{"power of attenuation", a.attenuationPower},
                             Number{"echo", a.echo, -most},
                             Number{"variation of the echo", a.echoVariation}};
    const auto* const wrong =
        std::ranges::find_if(numbers, [](const Number& n) { return !(n.value >= n.low && n.value <= n.high); });
    if (wrong != numbers.end()) {
        throw base::error("tissue table '{}': tissue '{}': {} is {:g}: must be a number{}", table, row.name, wrong->name,
                          wrong->value,
                          wrong->low < 0       ? ""
                          : wrong->high < most ? fmt::format(" of 0 to {:g}", wrong->high)
                                               : " of 0 or more");
    }
}

void checkRow(const std::string& table, const TissueRow& row)
{
    const double e = row.youngsModulus;
    const bool isSolid = row.role != Role::air;
    base::failIf(
        !std::isfinite(e) || e < 0.0 || (isSolid && e == 0.0),
        "tissue table '{}': tissue '{}': Young's modulus is {:g} kPa: must be a positive number; only air has none", table,
        row.name, 1e-3 * e);
    base::failIf(!(row.poissonRatio >= 0.0 && row.poissonRatio < 0.5),
                 "tissue table '{}': tissue '{}': Poisson's ratio is {:g}: must be 0 to below 0.5", table, row.name,
                 row.poissonRatio);
    base::failIf(!(row.stiffening >= minStiffening && row.stiffening <= maxStiffening),
                 "tissue table '{}': tissue '{}': stiffening is {:g}: must be {:g} to {:g}", table, row.name,
                 row.stiffening, minStiffening, maxStiffening);
    checkNumbers(table, row);
}

}  // namespace

void checkTable(const TissueTable& table)
{
    base::failIf(table.rows.empty() || table.rows.front().role != Role::air,
                 "tissue table '{}': row 0 must be air, the outside", table.name);
    base::failIf(table.rows.size() > 256, "tissue table '{}' has {} rows; 256 is the most", table.name, table.rows.size());
    for (const TissueRow& row : table.rows) {
        checkRow(table.name, row);
    }
}

}  // namespace palpate::volume
