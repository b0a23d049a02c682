#include <haptics/measures.h>

#include <array>

namespace palpate::haptics {

namespace {

constexpr std::array<Measure, 23> all{{
    {"total", "total", 0, [](const Score& s) { return s.total; }},
    {"passes", "passes", 0, [](const Score& s) { return static_cast<double>(s.passes); }},
    {"targeting_error_mm", "target mm", 1, [](const Score& s) { return s.targetingError * 1e3; }},
    {"best_target_pct", "core %", 0, [](const Score& s) { return s.bestTargetFraction * 100; }},
    {"best_target_length_mm", "core mm", 1, [](const Score& s) { return s.bestTargetLength * 1e3; }},
    {"vital_contacts", "vital", 0, [](const Score& s) { return static_cast<double>(s.vitalContacts); }},
    {"vital_s", "vital s", 2, [](const Score& s) { return s.vitalSeconds; }},
    {"vital_depth_mm", "vital mm", 1, [](const Score& s) { return s.vitalDepth * 1e3; }},
    {"vital_margin_mm", "margin mm", 1, [](const Score& s) { return s.vitalMargin * 1e3; }},
    {"warnings", "warnings", 0, [](const Score& s) { return static_cast<double>(s.warnings); }},
    {"skin_contacts", "skin", 0, [](const Score& s) { return static_cast<double>(s.skinContacts); }},
    {"redirects", "redirects", 0, [](const Score& s) { return static_cast<double>(s.redirects); }},
    {"seconds", "time s", 1, [](const Score& s) { return s.seconds; }},
    {"path_mm", "path mm", 0, [](const Score& s) { return s.pathLength * 1e3; }},
    {"inserted_path_mm", "inside mm", 0, [](const Score& s) { return s.insertedPath * 1e3; }},
    {"deepest_mm", "deepest mm", 1, [](const Score& s) { return s.deepest * 1e3; }},
    {"jerk_m_s3", "jerk m/s3", 1, [](const Score& s) { return s.jerk; }},
    {"tissue_work_mj", "work mJ", 0, [](const Score& s) { return s.tissueWork * 1e3; }},
    {"peak_force_n", "peak N", 2, [](const Score& s) { return s.peakForce; }},
    {"mean_force_n", "mean N", 2, [](const Score& s) { return s.meanForce; }},
    {"marks", "marks", 0, [](const Score& s) { return static_cast<double>(s.marks); }},
    {"mark_error_mm", "mark mm", 1, [](const Score& s) { return s.markError * 1e3; }},
    {"mark_size_error_mm", "size mm", 1, [](const Score& s) { return s.markSizeError * 1e3; }},
}};

}  // namespace

std::span<const Measure> measures() noexcept
{
    return all;
}

}  // namespace palpate::haptics
