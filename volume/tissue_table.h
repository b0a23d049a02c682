#pragma once

#include <volume/relaxation.h>

#include <glm/vec3.hpp>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::volume {

/// What a tissue means to the one who holds the needle.
enum class Role : std::uint8_t { plain, skin, tumour, vital, bone, air };

std::string_view name(Role role) noexcept;
std::optional<Role> roleNamed(std::string_view name) noexcept;

/// How the echo of a tissue varies from place to place: evenly, as lobules in stroma, as fibres along z, or as septa
/// between lobules.
enum class EchoPattern : std::uint8_t { even, lobules, fibres, septa };
inline constexpr std::array<std::string_view, 4> echoPatterns{"even", "lobules", "fibres", "septa"};

/// What a tissue does to ultrasound. Attenuation one way is `attenuation` f^`attenuationPower` with f in MHz.
struct Acoustics {
    double soundSpeed = 0;                    // [m/s]; 0: the table says nothing of ultrasound
    double attenuation = 0;                   // [dB/cm at 1 MHz]
    double attenuationPower = 1;              // of the frequency [-]
    double echo = 0;                          // level of the speckle over that of breast fat [dB]
    double echoVariation = 0;                 // from place to place, about its largest [dB]
    EchoPattern pattern = EchoPattern::even;  // of that variation
    std::string source;                       // where the numbers come from
    /// Whether the table says anything of ultrasound.
    bool given() const noexcept { return soundSpeed > 0; }
};

/// One tissue. SI units. Every row says where its numbers come from.
struct TissueRow {
    std::string name;             // as scenes and label maps call it
    Role role = Role::plain;      // what a core or a touch of it means
    double youngsModulus = 0;     // small strain [Pa]
    double poissonRatio = 0;      // [-]
    double stiffening = 0;        // b of finite strain: the shear modulus begins to grow as 1 + b I, see law.h [-]
    double density = 0;           // [kg/m^3]
    double compress = 0;          // ChainMail: shortest link, fraction of its rest length, in (0, 1]
    double stretch = 0;           // ChainMail: longest link, fraction of its rest length, >= 1
    double shear = 0;             // ChainMail: largest shift across a link, fraction of its rest length, >= 0
    double punctureForce = 0;     // tip force at which a 14 G needle enters [N]
    double cuttingForce = 0;      // tip force while it cuts on [N]
    double frictionPerMetre = 0;  // on a sliding shaft, per metre inside [N/m]
    double stictionPerMetre =
        0;                       // at which a shaft that sticks breaks loose, per metre inside; less than friction: as that
    double frictionDamping = 0;  // grows the friction with the shaft's speed, per metre inside [N s/m^2]
    double relaxingFast = 0;     // of the stress right after a step, gone within relaxationTimes[0] [-]
    double relaxingSlow = 0;     // and within relaxationTimes[1] [-]
    double wallSpacing = 0;      // mean distance between walls inside it, along a needle [m]; 0: none
    double wallForce = 0;        // mean over these of what they hold beyond the cutting force [N]
    bool fixed = false;          // held in space: bone, chest wall
    glm::vec3 colour{1.0F};      // display, RGB in [0, 1]
    float opacity = 0;           // display, in [0, 1]
    std::string source;          // where the numbers come from
    std::string relaxationSource;  // where relaxingFast and relaxingSlow come from
    std::string wallSource;        // where wallSpacing and wallForce come from
    Acoustics acoustics;           // for the ultrasound picture; forces do not depend on it

    /// How its stress falls while it is held.
    Relaxation relaxation() const noexcept { return {{relaxingFast, relaxingSlow}}; }
};

/// Rows in order; row 0 is always "air", the outside.
struct TissueTable {
    std::string name;             // where it comes from
    std::vector<TissueRow> rows;  // at most 64

    /// Index of the row called `name`, or nothing.
    std::optional<std::uint8_t> find(std::string_view name) const noexcept;
};

}  // namespace palpate::volume
