#include <datasets/scene_text.h>

#include <datasets/toml_fields.h>

#include <fmt/format.h>

#include <array>

namespace palpate::datasets {

namespace {

constexpr int maxSlices = 9;
constexpr int usualSlices = 3;

constexpr std::array<Field<CtSpec>, 2> ctFields{{
    {"slice_mm", "mm", 0.5, 20, 1e-3, &CtSpec::width},
    {"ctdi_mgy", "mGy", 0.1, 100, 1, &CtSpec::doseIndex},
}};

}  // namespace

void readCt(Section& top, CtSpec& ct)
{
    if (std::optional<Section> section = top.section("ct")) {
        ct.slices = static_cast<int>(section->integer("slices", "", 1, maxSlices).value_or(usualSlices));
        section->refuseIf(ct.slices % 2 == 0, "slices", "must be odd: the middle one goes through the tip");
        readFields<CtSpec>(*section, ctFields, ct, Need::some);
        section->finish();
    }
}

std::string ctText(const CtSpec& ct)
{
    return ct.given() ? fmt::format("\n[ct]\nslices = {}\n{}", ct.slices, writeFields<CtSpec>(ctFields, ct))
                      : std::string();
}

}  // namespace palpate::datasets
