#pragma once

#include <datasets/scene.h>
#include <volume/tissue.h>

#include <optional>
#include <string>
#include <vector>

namespace palpate::datasets {

/// What a needle goes through on its way.
struct Crossing {
    std::string structure, tissue;
    double length = 0;  // of the needle's axis in it [m]
};

/// What is to be said of a way.
struct WayVerdict {
    std::vector<Crossing> crossings;    // in the order of the way, the target left out
    std::vector<std::string> refusals;  // why no needle goes there; none: it may
    std::vector<std::string> warnings;  // what is not safe to rely on
    std::string corridor;               // "between ribs", "from the back", or nothing
    double detour = 0;                  // a way without its faults is as good if it is no longer than that [m]
};

/// Judges ways by all that lies on them: labels, and the image where the volume came with a CT.
///
/// Refused: what must not be pierced; lung, bowel, stomach and other hollow organs, unless the target lies in one, which is
/// then crossed once; the mediastinum (what is between two lungs); what the CT shows as blood with contrast medium or as
/// bone where no label says so. Warned: outside, by the labels, where the CT shows tissue; an entry that, by the CT, lies
/// inside the patient; a volume in which nothing is skin. docs/researcher.md has the rules with their sources.
class WayJudge {
public:
    /// The volume must outlive it. Keeps its image in memory.
    WayJudge(const Scene& scene, const volume::Tissue& tissue);

    /// The way from `entry` to `aim`, and on to `end`, where the fired tip comes to rest [m]; `reader` is of the same
    /// volume.
    WayVerdict judge(const volume::Tissue::Reader& reader, Vec3 entry, Vec3 aim, Vec3 end) const;

private:
    struct Walk;

    std::optional<float> image(Vec3 p) const;
    bool inMediastinum(const volume::Tissue::Reader& reader, Vec3 p) const;
    void cross(Walk& walk, Vec3 p, double step, WayVerdict& out) const;
    void judgeCrossings(const Walk& walk, WayVerdict& out) const;
    void lookOutside(Vec3 entry, Vec3 outward, WayVerdict& out) const;
    void nameCorridor(const volume::Tissue::Reader& reader, Vec3 entry, Vec3 aim, WayVerdict& out) const;

    const volume::Tissue& tissue_;
    std::vector<std::string> nameOf_;    // by label value; "" = none
    std::vector<std::string> tissueOf_;  // its tissue's name
    std::vector<char> target_, vital_;
    bool hasSkin_ = false, hasLung_ = false, hasBone_ = false;
    std::vector<float> hu_;  // empty: no CT
    std::string organ_;      // tissue of the target
};

}  // namespace palpate::datasets
