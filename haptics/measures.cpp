#include <haptics/measures.h>

#include <base/words.h>

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <limits>

namespace palpate::haptics {

namespace {

using Listed = Measure::Listed;

// What a session cannot have; infinite is what it did not reach.
constexpr double none = std::numeric_limits<double>::quiet_NaN();

// Nothing where no core is asked for, and none was taken.
double ofCores(const Score& s, double value)
{
    return s.passes > 0 || judgedBy(s) == Judged::core ? value : none;
}

// Nothing where the scene holds no probe.
double ofProbe(const Score& s, double value)
{
    return s.hasProbe ? value : none;
}

// Nothing where it has no CT.
double ofCt(const Score& s, double value)
{
    return s.scanDose > 0 ? value : none;
}

// Nothing where it asks for something else.
double ofTask(const Score& s, datasets::SessionTask task, double value)
{
    return s.aim.task == task ? value : none;
}

// Nothing where nothing is to be marked, and nothing was.
double ofMarks(const Score& s, double value)
{
    return s.marks > 0 || judgedBy(s) == Judged::marks ? value : none;
}

// Nothing where no needle was inside, or nothing vital is.
double ofMargin(const Score& s, double value)
{
    return std::isfinite(s.vitalMargin) ? value : none;
}

constexpr std::array<Measure, 36> all{{
    {"total", "total", "Total", "of 100", 0, Listed::never, [](const Score& s) { return s.total; }},
    {"passes", "passes", "Passes", "", 0, Listed::always, [](const Score& s) { return static_cast<double>(s.passes); }},
    {"targeting_error_mm", "target mm", "Targeting error", "mm", 1, Listed::ifFired,
     [](const Score& s) { return ofCores(s, s.targetingError * 1e3); }},
    {"best_target_pct", "core %", "Target in best core", "%", 0, Listed::ifFired,
     [](const Score& s) { return ofCores(s, s.bestTargetFraction * 100); }},
    {"best_target_length_mm", "core mm", "Length in target", "mm", 1, Listed::ifFired,
     [](const Score& s) { return ofCores(s, s.bestTargetLength * 1e3); }},
    {"vital_contacts", "vital", "Vital contacts", "", 0, Listed::always,
     [](const Score& s) { return static_cast<double>(s.vitalContacts); }},
    {"vital_s", "vital s", "Time in vital structures", "s", 2, Listed::always,
     [](const Score& s) { return s.vitalSeconds; }},
    {"vital_depth_mm", "vital mm", "Depth in vital structures", "mm", 1, Listed::always,
     [](const Score& s) { return s.vitalDepth * 1e3; }},
    {"vital_margin_mm", "margin mm", "Nearest to a vital structure", "mm", 1, Listed::always,
     [](const Score& s) { return ofMargin(s, s.vitalMargin * 1e3); }},
    {"warnings", "warnings", "Warnings", "", 0, Listed::always,
     [](const Score& s) { return static_cast<double>(s.warnings); }},
    {"skin_contacts", "skin", "Skin contacts", "", 0, Listed::always,
     [](const Score& s) { return static_cast<double>(s.skinContacts); }},
    {"redirects", "redirects", "Redirects", "", 0, Listed::always,
     [](const Score& s) { return static_cast<double>(s.redirects); }},
    {"seconds", "time s", "Time", "s", 1, Listed::always, [](const Score& s) { return s.seconds; }},
    {"path_mm", "path mm", "Path of the tip", "mm", 0, Listed::always, [](const Score& s) { return s.pathLength * 1e3; }},
    {"inserted_path_mm", "inside mm", "Path inside", "mm", 0, Listed::always,
     [](const Score& s) { return s.insertedPath * 1e3; }},
    {"deepest_mm", "deepest mm", "Deepest insertion", "mm", 1, Listed::always,
     [](const Score& s) { return s.deepest * 1e3; }},
    {"beyond_target_mm", "beyond mm", "Deeper than the target", "mm", 1, Listed::always,
     [](const Score& s) { return s.beyondTarget * 1e3; }},
    {"jerk_m_s3", "jerk m/s3", "Jerk (root mean square)", "m/s3", 1, Listed::always, [](const Score& s) { return s.jerk; }},
    {"tissue_work_mj", "work mJ", "Work on the tissue", "mJ", 0, Listed::always,
     [](const Score& s) { return s.tissueWork * 1e3; }},
    {"peak_force_n", "peak N", "Peak force", "N", 2, Listed::always, [](const Score& s) { return s.peakForce; }},
    {"mean_force_n", "mean N", "Mean force in contact", "N", 2, Listed::always, [](const Score& s) { return s.meanForce; }},
    {"marks", "marks", "Marks", "", 0, Listed::never, [](const Score& s) { return static_cast<double>(s.marks); }},
    {"mark_error_mm", "mark mm", "Marked beside the middle by", "mm", 1, Listed::ifMarked,
     [](const Score& s) { return ofMarks(s, s.markError * 1e3); }},
    {"mark_size_error_mm", "size mm", "Size marked wrong by", "mm", 1, Listed::ifMarked,
     [](const Score& s) { return ofMarks(s, s.markSizeError * 1e3); }},
    {"probe_s", "probe s", "Probe on the skin", "s", 1, Listed::ifProbe,
     [](const Score& s) { return ofProbe(s, s.probeSeconds); }},
    {"needle_in_beam_mm", "beam mm", "Needle in the picture (mean)", "mm", 1, Listed::ifProbe,
     [](const Score& s) { return ofProbe(s, s.needleInBeam * 1e3); }},
    {"needle_in_beam_pct", "beam %", "Shaft in the picture", "%", 0, Listed::ifProbe,
     [](const Score& s) { return ofProbe(s, s.needleShare * 100); }},
    {"least_in_beam_mm", "least mm", "Needle in the picture (least)", "mm", 1, Listed::ifProbe,
     [](const Score& s) { return ofProbe(s, s.minInBeam * 1e3); }},
    {"tip_in_beam_pct", "tip %", "Tip in the picture", "%", 0, Listed::ifProbe,
     [](const Score& s) { return ofProbe(s, s.tipShare * 100); }},
    {"blind_advance_mm", "blind mm", "Advanced without seeing it", "mm", 1, Listed::ifProbe,
     [](const Score& s) { return ofProbe(s, s.blindAdvance * 1e3); }},
    {"pictures_before", "before", "Pictures before the shot", "", 0, Listed::ifProbe,
     [](const Score& s) { return ofProbe(s, static_cast<double>(s.picturesBefore)); }},
    {"pictures_after", "after", "Pictures after a shot", "", 0, Listed::ifProbe,
     [](const Score& s) { return ofProbe(s, static_cast<double>(s.picturesAfter)); }},
    {"ct_scans", "scans", "CT scans", "", 0, Listed::ifCt,
     [](const Score& s) { return ofCt(s, static_cast<double>(s.scans)); }},
    {"ct_dose_mgy_cm", "mGy cm", "Dose of the CT scans", "mGy cm", 1, Listed::ifCt,
     [](const Score& s) { return ofCt(s, s.scans * s.scanDose); }},
    {"rest_s", "rest s", "Rest on the skin", "s", 1, Listed::ifTouch,
     [](const Score& s) { return ofTask(s, datasets::SessionTask::touch, s.rest); }},
    {"tip_to_target_mm", "tip mm", "Tip's nearest to the target", "mm", 1, Listed::ifAdvance,
     [](const Score& s) { return ofTask(s, datasets::SessionTask::advance, s.tipToTarget * 1e3); }},
}};

bool isListed(Listed listed, const Score& score)
{
    switch (listed) {
        case Listed::never:
            return false;
        case Listed::ifFired:
            return score.passes > 0 || judgedBy(score) == Judged::core;
        case Listed::ifMarked:
            return score.marks > 0;
        case Listed::ifProbe:
            return score.hasProbe;
        case Listed::ifCt:
            return score.scanDose > 0;
        case Listed::ifTouch:
            return score.aim.task == datasets::SessionTask::touch;
        case Listed::ifAdvance:
            return score.aim.task == datasets::SessionTask::advance;
        default:
            return true;
    }
}

}  // namespace

const char* labelOfCore(const Score& score) noexcept
{
    return base::nameOfCore(judgedNames[static_cast<std::size_t>(judgedBy(score))]);
}

std::span<const Measure> measures() noexcept
{
    return all;
}

LabelledValues describeTotal(const Score& score)
{
    LabelledValues lines{{"Total", fmt::format("{:.0f} of 100", score.total)}};
    const ScoreParts points = parts(score);
    for (const PartOfTotal& part : partsOfTotal) {
        lines.emplace_back(part.points == &ScoreParts::core ? labelOfCore(score) : part.label,
                           fmt::format("{:.0f} of {:.0f}", points.*part.points, part.most));
    }
    return lines;
}

LabelledValues describeMeasures(const Score& score)
{
    LabelledValues lines;
    for (const Measure& m : all) {
        if (!isListed(m.listed, score)) {
            continue;
        }
        const double value = m.value(score);
        const bool missing = !std::isfinite(value) || (m.listed == Listed::ifFired && score.passes == 0);
        const char* const space = *m.unit == 0 ? "" : " ";
        lines.emplace_back(m.label, missing ? "-" : fmt::format("{:.{}f}{}{}", value, m.decimals, space, m.unit));
    }
    return lines;
}

LabelledValues describe(const Score& score)
{
    LabelledValues lines = describeTotal(score);
    for (auto& line : describeMeasures(score)) {
        lines.push_back(std::move(line));
    }
    return lines;
}

}  // namespace palpate::haptics
