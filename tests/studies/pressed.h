#pragma once

#include <studies/press/press.h>

#include <span>
#include <vector>

namespace palpate::studies {

inline datasets::ToolSpec toolOf(datasets::ToolKind kind, double radius, double length)
{
    datasets::ToolSpec tool;
    tool.kind = kind;
    tool.radius = radius;
    tool.length = length;
    return tool;
}

struct Pressed {
    std::vector<PressSample> samples;
    PressSummary summary;
};

inline Pressed pressed(const haptics::SessionModel& model, const PosePath& path, const PressOptions& options,
                       std::span<const FilePoint> asked = {})
{
    Pressed out;
    out.summary = press(model, path, asked, options, [&](const PressSample& s) { out.samples.push_back(s); });
    return out;
}

}  // namespace palpate::studies
