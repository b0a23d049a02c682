#include <base/error.h>
#include <base/mapped.h>
#include <datasets/insert.h>
#include <datasets/scene.h>
#include <datasets/scene_text.h>
#include <datasets/tables.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <ranges>
#include <utility>

namespace palpate::datasets {

namespace {

using volume::Role;
using volume::Structure;
using volume::Tissue;

std::string lower(std::string text)
{
    std::transform(text.begin(), text.end(), text.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return text;
}

Role roleOf(const Tissue& tissue, const Structure& structure)
{
    return tissue.table().rows[structure.tissue].role;
}

struct Candidate {
    std::string name;
    double volume = 0;
};

// Tissues of role vital by name; a structure that its tissue's name does not reach, because another structure is called so,
// stands for itself.
std::vector<VitalStructure> chooseVital(const Tissue& tissue, const std::string& target)
{
    const std::vector<std::uint16_t> sampled = tissue.labelsNamed(target);
    const auto holds = [](const std::vector<std::uint16_t>& labels, std::uint16_t value) {
        return std::find(labels.begin(), labels.end(), value) != labels.end();
    };
    std::vector<Candidate> candidates;
    for (const Structure& s : tissue.structures()) {
        if (roleOf(tissue, s) != Role::vital || holds(sampled, s.value)) {
            continue;
        }
        const std::string& row = tissue.table().rows[s.tissue].name;
        const std::string name = holds(tissue.labelsNamed(row), s.value) ? row : s.name;
        const auto known =
            std::find_if(candidates.begin(), candidates.end(), [&](const Candidate& c) { return c.name == name; });
        if (known == candidates.end()) {
            candidates.push_back({name, s.volume});
        } else {
            known->volume += s.volume;
        }
    }
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.volume > b.volume; });
    candidates.resize(std::min(candidates.size(), maxVital));
    return base::mapped<VitalStructure>(candidates, [&](const Candidate& c) { return VitalStructure{.name = c.name}; });
}

Tissue volumeAlone(const Scene& scene)
{
    if (scene.source.file.empty()) {
        auto table = scene.tissues.empty() ? defaultTissues() : loadTissues(scene.tissues);
        return makePhantom(scene.source.phantom, withChanges(std::move(table), scene.tissueChanges));
    }
    base::failIf(scene.source.file.extension() != ".vdb", "{}: not a .vdb volume: convert it with `palpate import`",
                 scene.source.file.native());
    Tissue tissue = Tissue::load(scene.source.file);
    return scene.tissueChanges.empty() ? std::move(tissue)
                                       : withTable(tissue, withChanges(tissue.table(), scene.tissueChanges));
}

}  // namespace

std::vector<std::string> solidNames(const Tissue& tissue)
{
    auto solid = tissue.structures() | std::views::filter([&](auto& s) { return roleOf(tissue, s) != Role::air; });
    return base::mapped<std::string>(solid, &Structure::name);
}

std::string lesionOf(const Tissue& tissue)
{
    const std::span<const Structure> all = tissue.structures();
    const auto tumour =
        std::find_if(all.begin(), all.end(), [&](const Structure& s) { return roleOf(tissue, s) == Role::tumour; });
    if (tumour != all.end()) {
        return tumour->name;
    }
    static constexpr std::array<std::string_view, 6> hints{"lesion", "tumor", "mass", "nodule", "target", "tdlu"};
    for (const std::string_view hint : hints) {
        for (const Structure& s : all) {
            if (roleOf(tissue, s) != Role::air && lower(s.name).find(hint) != std::string::npos) {
                return s.name;
            }
        }
    }
    return "";
}

std::string largestStructure(const Tissue& tissue)
{
    const Structure* largest = nullptr;
    for (const Structure& s : tissue.structures()) {
        if (roleOf(tissue, s) != Role::air && (largest == nullptr || s.volume > largest->volume)) {
            largest = &s;
        }
    }
    return largest != nullptr ? largest->name : "";
}

Scene sceneForVolume(const std::filesystem::path& file, const Tissue& tissue, const std::string& target)
{
    const std::string aim = target.empty() ? lesionOf(tissue) : target;
    base::failIf(aim.empty() && solidNames(tissue).empty(), "{}: has no labels of tissue: there is nothing to aim at",
                 file.native());
    base::failIf(aim.empty(), "{}: no tumour or lesion to aim at: choose with --target NAME, one of {}", file.native(),
                 fmt::join(solidNames(tissue), ", "));
    Scene scene;
    scene.name = file.stem().string();
    scene.source.file = std::filesystem::absolute(file).lexically_normal();
    scene.dffb = builtInScene("breast")->dffb;
    scene.target = aim;
    scene.vital = chooseVital(tissue, scene.target);
    return parseScene(sceneText(scene), file);
}

Tissue sceneVolume(const Scene& scene)
{
    Tissue tissue = volumeAlone(scene);
    return scene.source.inserts.empty() ? std::move(tissue) : withInserts(tissue, scene.source.inserts);
}

}  // namespace palpate::datasets
