#include <haptics/measures.h>

#include <base/printable.h>
#include <base/words.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace palpate::haptics {

namespace {

using Listed = Measure::Listed;

// What a session cannot have; infinite is what it did not reach.
constexpr double none = std::numeric_limits<double>::quiet_NaN();

bool always(const Score&)
{
    return true;
}

// A core is asked for, or one was taken.
bool hasCores(const Score& s)
{
    return s.passes > 0 || judgedBy(s) == Judged::core;
}

bool hasMarks(const Score& s)
{
    return s.marks > 0 || judgedBy(s) == Judged::marks;
}

bool hasProbe(const Score& s)
{
    return s.hasProbe;
}

bool hasCt(const Score& s)
{
    return s.scanDose > 0;
}

// No vital structure was met where the margin is infinite.
bool hasMargin(const Score& s)
{
    return std::isfinite(s.vitalMargin);
}

template <datasets::SessionTask task>
bool asks(const Score& s)
{
    return s.aim.task == task;
}

// A member of the score in the measure's unit; none of a session that cannot have it.
template <auto member, int times = 1, bool (*has)(const Score&) = always>
double of(const Score& s)
{
    return has(s) ? static_cast<double>(s.*member) * times : none;
}

using datasets::SessionTask;

constexpr std::array<Measure, 36> all{{
    {"total", "total", "Total", "of 100", 0, Listed::never, of<&Score::total>},
    {"passes", "passes", "Passes", "", 0, Listed::always, of<&Score::passes>},
    {"targeting_error_mm", "target mm", "Targeting error", "mm", 1, Listed::ifFired,
     of<&Score::targetingError, 1000, hasCores>},
    {"best_target_pct", "core %", "Target in best core", "%", 0, Listed::ifFired,
     of<&Score::bestTargetFraction, 100, hasCores>},
    {"best_target_length_mm", "core mm", "Length in target", "mm", 1, Listed::ifFired,
     of<&Score::bestTargetLength, 1000, hasCores>},
    {"vital_contacts", "vital", "Vital contacts", "", 0, Listed::always, of<&Score::vitalContacts>},
    {"vital_s", "vital s", "Time in vital structures", "s", 2, Listed::always, of<&Score::vitalSeconds>},
    {"vital_depth_mm", "vital mm", "Depth in vital structures", "mm", 1, Listed::always, of<&Score::vitalDepth, 1000>},
    {"vital_margin_mm", "margin mm", "Nearest to a vital structure", "mm", 1, Listed::always,
     of<&Score::vitalMargin, 1000, hasMargin>},
    {"warnings", "warnings", "Warnings", "", 0, Listed::always, of<&Score::warnings>},
    {"skin_contacts", "skin", "Skin contacts", "", 0, Listed::always, of<&Score::skinContacts>},
    {"redirects", "redirects", "Redirects", "", 0, Listed::always, of<&Score::redirects>},
    {"seconds", "time s", "Time", "s", 1, Listed::always, of<&Score::seconds>},
    {"path_mm", "path mm", "Path of the tip", "mm", 0, Listed::always, of<&Score::pathLength, 1000>},
    {"inserted_path_mm", "inside mm", "Path inside", "mm", 0, Listed::always, of<&Score::insertedPath, 1000>},
    {"deepest_mm", "deepest mm", "Deepest insertion", "mm", 1, Listed::always, of<&Score::deepest, 1000>},
    {"beyond_target_mm", "beyond mm", "Deeper than the target", "mm", 1, Listed::always, of<&Score::beyondTarget, 1000>},
    {"jerk_m_s3", "jerk m/s3", "Jerk (root mean square)", "m/s3", 1, Listed::always, of<&Score::jerk>},
    {"tissue_work_mj", "work mJ", "Work on the tissue", "mJ", 0, Listed::always, of<&Score::tissueWork, 1000>},
    {"peak_force_n", "peak N", "Peak force", "N", 2, Listed::always, of<&Score::peakForce>},
    {"mean_force_n", "mean N", "Mean force in contact", "N", 2, Listed::always, of<&Score::meanForce>},
    {"marks", "marks", "Marks", "", 0, Listed::never, of<&Score::marks>},
    {"mark_error_mm", "mark mm", "Marked beside the middle by", "mm", 1, Listed::ifMarked,
     of<&Score::markError, 1000, hasMarks>},
    {"mark_size_error_mm", "size mm", "Size marked wrong by", "mm", 1, Listed::ifMarked,
     of<&Score::markSizeError, 1000, hasMarks>},
    {"probe_s", "probe s", "Probe on the skin", "s", 1, Listed::ifProbe, of<&Score::probeSeconds, 1, hasProbe>},
    {"needle_in_beam_mm", "beam mm", "Needle in the picture (mean)", "mm", 1, Listed::ifProbe,
     of<&Score::needleInBeam, 1000, hasProbe>},
    {"needle_in_beam_pct", "beam %", "Shaft in the picture", "%", 0, Listed::ifProbe,
     of<&Score::needleShare, 100, hasProbe>},
    {"least_in_beam_mm", "least mm", "Needle in the picture (least)", "mm", 1, Listed::ifProbe,
     of<&Score::minInBeam, 1000, hasProbe>},
    {"tip_in_beam_pct", "tip %", "Tip in the picture", "%", 0, Listed::ifProbe, of<&Score::tipShare, 100, hasProbe>},
    {"blind_advance_mm", "blind mm", "Advanced without seeing it", "mm", 1, Listed::ifProbe,
     of<&Score::blindAdvance, 1000, hasProbe>},
    {"pictures_before", "before", "Pictures before the shot", "", 0, Listed::ifProbe,
     of<&Score::picturesBefore, 1, hasProbe>},
    {"pictures_after", "after", "Pictures after a shot", "", 0, Listed::ifProbe, of<&Score::picturesAfter, 1, hasProbe>},
    {"ct_scans", "scans", "CT scans", "", 0, Listed::ifCt, of<&Score::scans, 1, hasCt>},
    {"ct_dose_mgy_cm", "mGy cm", "Dose of the CT scans", "mGy cm", 1, Listed::ifCt,
     [](const Score& s) { return hasCt(s) ? s.scans * s.scanDose : none; }},
    {"rest_s", "rest s", "Rest on the skin", "s", 1, Listed::ifTouch, of<&Score::rest, 1, asks<SessionTask::touch>>},
    {"tip_to_target_mm", "tip mm", "Tip's nearest to the target", "mm", 1, Listed::ifAdvance,
     of<&Score::tipToTarget, 1000, asks<SessionTask::advance>>},
}};

// By Listed.
constexpr std::array<bool (*)(const Score&), 8> listedIf{always,
                                                         hasCores,
                                                         [](const Score& s) { return s.marks > 0; },
                                                         hasProbe,
                                                         hasCt,
                                                         asks<SessionTask::touch>,
                                                         asks<SessionTask::advance>,
                                                         [](const Score&) { return false; }};

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
        if (!listedIf[static_cast<std::size_t>(m.listed)](score)) {
            continue;
        }
        const double value = m.value(score);
        const bool missing = !std::isfinite(value) || (m.listed == Listed::ifFired && score.passes == 0);
        const char* const space = *m.unit == 0 ? "" : " ";
        lines.emplace_back(
            m.label,
            missing ? "-" : fmt::format("{:.{}f}{}{}", base::printable(value, m.decimals), m.decimals, space, m.unit));
    }
    return lines;
}

LabelledValues describe(const Score& score)
{
    LabelledValues lines = describeTotal(score);
    std::ranges::move(describeMeasures(score), std::back_inserter(lines));
    return lines;
}

}  // namespace palpate::haptics
