#include <datasets/scene_text.h>

#include <base/units.h>
#include <base/utf8.h>
#include <datasets/embedded.h>
#include <datasets/scene_fields.h>
#include <datasets/toml_fields.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <stdexcept>

namespace palpate::datasets {

namespace {

using units::degree;
constexpr std::size_t maxSteps = 1000;  // of a script

constexpr std::array<std::string_view, 4> taskNames{"biopsy", "find", "touch", "advance"};
constexpr std::size_t maxInserts = 32;
constexpr std::array<std::string_view, 3> dffbModes{"off", "thesis", "field"};
constexpr std::array<std::string_view, 2> strains{"small", "finite"};
constexpr std::array<std::string_view, 5> stepKinds{"move", "press", "fire", "wait", "pierce"};

constexpr std::array<Field<DffbParameters>, 5> dffbFields{{
    {"floor_mm", "mm", 0.1, 50, 1e-3, &DffbParameters::floorDistance},
    {"range_mm", "mm", 0, 100, 1e-3, &DffbParameters::range},
    {"budget_n", "N", 0, 50, 1, &DffbParameters::budget},
    {"gain", "", 0, 1, 1, &DffbParameters::gain},
    {"fade_s", "s", 0, 86400, 1, &DffbParameters::fade},
}};

constexpr std::array<Field<ForceTerm>, 4> termFields{{
    {"force_n", "N", 0, 50, 1, &ForceTerm::force},
    {"mass_kg", "kg", 0, 5, 1, &ForceTerm::mass},
    {"damping_ns_m", "N s/m", 0, 100, 1, &ForceTerm::damping},
    {"stiffness_n_m", "N/m", 0, 5000, 1, &ForceTerm::stiffness},
}};

struct Term {
    std::string_view key;
    ForceTerm DffbParameters::*member;
};
constexpr std::array<Term, 4> terms{{{"surgery", &DffbParameters::surgery},
                                     {"structure", &DffbParameters::structure},
                                     {"tissue", &DffbParameters::tissue},
                                     {"task", &DffbParameters::task}}};

constexpr std::array<Field<VitalStructure>, 3> vitalFields{{
    {"name", "", 0, 0, 1, &VitalStructure::name},
    {"gain", "", 0, 100, 1, &VitalStructure::gain},
    {"warn_mm", "mm", 0, 100, 1e-3, &VitalStructure::warnDistance},
}};

constexpr std::array<Field<Insert>, 4> insertFields{{
    {"name", "", 0, 0, 1, &Insert::name},
    {"tissue", "", 0, 0, 1, &Insert::tissue},
    {"diameter_mm", "mm", 0.2, 100, 1e-3, &Insert::diameter},
    {"spiculated", "", 0, 0, 1, &Insert::spiculated},
}};

constexpr std::array<Field<TraineeStep>, 3> stepFields{{
    {"speed_mm_s", "mm/s", 0.1, 2000, 1e-3, &TraineeStep::speed},
    {"seconds", "s", 0, 3600, 1, &TraineeStep::seconds},
    {"tolerance_mm", "mm", 0.01, 50, 1e-3, &TraineeStep::tolerance},
}};

template <class Enum, std::size_t N>
void readChoice(Section& section, std::string_view key, const std::array<std::string_view, N>& names, Enum& value)
{
    if (const auto index = section.choice(key, names)) {
        value = static_cast<Enum>(*index);
    }
}

void readPhantom(Section& volume, PhantomSpec& spec)
{
    const std::vector<std::string> names = phantomNames();
    const std::vector<std::string_view> choices(names.begin(), names.end());
    spec.name = choices[*volume.choice("phantom", choices)];
    if (const auto seed = volume.integer("seed", "", 0, std::numeric_limits<std::int64_t>::max())) {
        spec.seed = static_cast<std::uint64_t>(*seed);
    }
    spec.voxel = volume.number("voxel_mm", "mm", 0.1, 5).value_or(spec.voxel * 1e3) * 1e-3;
    std::optional<Section> parameters = volume.section("parameters");
    if (!parameters) {
        return;
    }
    for (const PhantomParameter& p : phantomParameters(spec.name)) {
        if (!p.word.empty()) {
            if (const auto word = parameters->word(p.name)) {
                spec.words[p.name] = *word;
            }
        } else if (const auto number = parameters->number(p.name, p.unit, p.low, p.high)) {
            spec.numbers[p.name] = *number;
        }
    }
    parameters->finish();
}

std::filesystem::path resolved(const std::string& file, const std::filesystem::path& origin)
{
    const std::filesystem::path path(file);
    return path.is_absolute() ? path : std::filesystem::absolute(origin.parent_path() / path).lexically_normal();
}

void readVolume(Section& top, const std::filesystem::path& origin, VolumeSource& source)
{
    std::optional<Section> volume = top.section("volume");
    top.missingIf(!volume, "[volume]", "a scene needs file = \"..\" or phantom = \"..\" in it");
    top.refuseIf(volume->has("file") == volume->has("phantom"), "volume",
                 "needs one of file = \"..\" and phantom = \"..\"");
    if (const auto file = volume->word("file")) {
        source.file = resolved(*file, origin);
    } else {
        readPhantom(*volume, source.phantom);
    }
    volume->finish();
}

void readDffb(Section& top, DffbParameters& dffb)
{
    std::optional<Section> section = top.section("dffb");
    if (!section) {
        return;
    }
    readChoice(*section, "mode", dffbModes, dffb.mode);
    readFields<DffbParameters>(*section, dffbFields, dffb, Need::some);
    for (const Term& term : terms) {
        if (std::optional<Section> inner = section->section(term.key)) {
            readFields<ForceTerm>(*inner, termFields, dffb.*term.member, Need::some);
            inner->finish();
        }
    }
    const double mass = dffb.surgery.mass + dffb.structure.mass + dffb.tissue.mass + dffb.task.mass;
    section->refuseIf(dffb.mode == DffbMode::thesis && mass <= 0, "mode",
                      "gives no force without a mass: set mass_kg in [dffb.surgery] or another term");
    section->finish();
}

void readTool(Section& top, ToolSpec& tool)
{
    if (std::optional<Section> section = top.section("tool")) {
        readChoice(*section, "kind", toolKinds, tool.kind);
        readFields<ToolSpec>(*section, toolFields, tool, Need::some);
        section->finish();
        section->refuseIf(tool.kind == ToolKind::needle && tool.notchRadius >= tool.radius,
                          section->has("notch_radius_mm") ? "notch_radius_mm" : "radius_mm",
                          "the notch must be narrower than the needle", "mm");
        section->refuseIf(tool.kind == ToolKind::needle && tool.tipLength >= tool.length,
                          section->has("tip_mm") ? "tip_mm" : "length_mm", "the tip must be shorter than the needle", "mm");
    }
}

// `strain` says whether the law is that of small strain, `law` which one of finite strain it is.
void readLaw(Section& elastic, volume::Law& law)
{
    if (const auto strain = elastic.choice("strain", strains)) {
        law = *strain == 0 ? volume::Law(volume::SmallStrain{}) : volume::Law(volume::NeoHookean{});
    }
    const auto finite = std::span(volume::lawNames).subspan(1);
    if (const auto index = elastic.choice("law", finite)) {
        elastic.refuseIf(volume::isSmall(law), "law",
                         "small strain has one law: leave this out, or set strain = \"finite\"");
        law = *volume::lawNamed(finite[*index]);
    }
}

// Returns whether it says anything of what a setting is about.
bool readElastic(Section& model, ElasticSettings& elastic)
{
    bool named = false;
    if (std::optional<Section> section = model.section("elastic")) {
        named = section->has("spacing_mm") || section->has("window") || section->has("cycles");
        readFields<ElasticSettings>(*section, elasticFields, elastic, Need::some);
        readLaw(*section, elastic.law);
        section->finish();
        section->refuseIf(elastic.window % 2 == 0, "window", "must be odd");
    }
    return named;
}

void readModel(Section& top, ModelSettings& model)
{
    if (std::optional<Section> section = top.section("model")) {
        readChoice(*section, "level", modelLevels, model.level);
        readFields<ModelSettings>(*section, modelFields, model, Need::some);
        const std::vector<std::string> names = elasticSettings();
        const std::vector<std::string_view> choices(names.begin(), names.end());
        if (const auto index = section->choice("setting", choices)) {
            model.setting = names[*index];
            model.elastic = elasticSetting(model.setting);
            model.settingNamed = true;
        }
        model.settingNamed = readElastic(*section, model.elastic) || model.settingNamed;
        section->finish();
    }
}

// Whether the target and each vital structure have names of their own: their measures are told apart by them.
enum class Names : std::uint8_t { once, any };

void readTarget(Section& top, Names names, Scene& scene)
{
    if (std::optional<Section> section = top.section("target")) {
        scene.target = section->word("structure").value_or(scene.target);
        const bool isVital = std::ranges::find(scene.vital, scene.target, &VitalStructure::name) != scene.vital.end();
        section->refuseIf(isVital && names == Names::once, "structure", "is in [[vital]] too: leave one of them out");
        scene.entry = section->point("entry_mm", farthestCoordinate);
        scene.aim = section->point("aim_mm", farthestCoordinate);
        section->finish();
    }
}

void readVital(Section& top, Names names, std::vector<VitalStructure>& vital)
{
    for (Section& section : top.sections("vital")) {
        VitalStructure structure;
        readFields<VitalStructure>(section, vitalFields, structure, Need::some);
        section.missingIf(structure.name.empty(), "name", "a structure or tissue of the volume");
        const bool isThere = std::ranges::find(vital, structure.name, &VitalStructure::name) != vital.end();
        section.refuseIf(isThere && names == Names::once, "name", "is in another [[vital]] too: leave one of them out");
        section.finish();
        vital.push_back(std::move(structure));
        section.refuseIf(vital.size() > maxVital, "name", fmt::format("over {} vital structures", maxVital));
    }
}

void readInserts(Section& top, std::vector<Insert>& inserts)
{
    for (Section& section : top.sections("insert")) {
        Insert insert;
        readFields<Insert>(section, insertFields, insert, Need::some);
        if (const auto centre = section.point("centre_mm", farthestCoordinate)) {
            insert.centre = *centre;
        } else {
            section.missing("centre_mm", "where it is: [x, y, z] in mm");
        }
        insert.to = section.point("to_mm", farthestCoordinate);
        section.refuseIf(insert.spiculated && insert.to, "spiculated", "a rod has no spikes: leave out to_mm");
        if (const auto seed = section.integer("seed", "", 0, std::numeric_limits<std::int64_t>::max())) {
            insert.seed = static_cast<std::uint64_t>(*seed);
        }
        section.finish();
        inserts.push_back(std::move(insert));
        section.refuseIf(inserts.size() > maxInserts, "name", fmt::format("over {} inserts", maxInserts));
    }
}

void readScript(Section& top, std::vector<TraineeStep>& script)
{
    for (Section& section : top.sections("script")) {
        TraineeStep step;
        section.missingIf(!section.has("kind"), "kind", "move, press, pierce, fire or wait");
        readChoice(section, "kind", stepKinds, step.kind);
        readFields<TraineeStep>(section, stepFields, step, Need::some);
        if (const auto to = section.point("to_mm", farthestCoordinate)) {
            step.to = *to;
        } else if (step.kind != TraineeStep::Kind::fire && step.kind != TraineeStep::Kind::wait) {
            section.missing("to_mm", "where the tip shall go: [x, y, z] in mm");
        }
        section.missingIf(step.kind == TraineeStep::Kind::wait && step.seconds <= 0, "seconds",
                          "how long to wait, above 0 s");
        section.finish();
        script.push_back(step);
        section.refuseIf(script.size() > maxSteps, "kind", fmt::format("over {} steps", maxSteps));
    }
}

// Replaces the TOML string `node` of `text` by `value`: a relative path by an absolute one, so that the text gives the same
// scene from every folder.
void replaceString(std::string& text, const toml::node* node, const std::string& value)
{
    const toml::source_region& at = node->source();
    const auto offset = [&](toml::source_position position) {
        std::size_t begin = 0;
        for (toml::source_index line = 1; line < position.line; ++line) {
            begin = text.find('\n', begin) + 1;
        }
        // Columns count code points.
        for (toml::source_index column = 1; column < position.column && begin < text.size();) {
            ++begin;
            column += begin == text.size() || base::beginsCharacter(text[begin]) ? 1U : 0U;
        }
        return begin;
    };
    const std::size_t begin = offset(at.begin);
    text.replace(begin, offset(at.end) - begin, tomlString(value));
}

std::string millimetres(Vec3 p)
{
    return fmt::format("[{:.12g}, {:.12g}, {:.12g}]", p.x * 1e3, p.y * 1e3, p.z * 1e3);
}

std::string phantomText(const PhantomSpec& spec)
{
    std::string out = fmt::format("phantom = {}\nseed = {}\nvoxel_mm = {:.12g}\n\n[volume.parameters]\n",
                                  tomlString(spec.name), spec.seed, spec.voxel * 1e3);
    for (const auto& [name, value] : spec.numbers) {
        out += fmt::format("{} = {:.12g}\n", name, value);
    }
    for (const auto& [name, value] : spec.words) {
        out += fmt::format("{} = {}\n", name, tomlString(value));
    }
    return out;
}

std::string modelText(const ModelSettings& model)
{
    std::string out =
        fmt::format("\n[model]\nlevel = \"{}\"\n{}", name(model.level), writeFields<ModelSettings>(modelFields, model));
    out += fmt::format("setting = {}\n", tomlString(model.setting));
    const volume::Law& law = model.elastic.law;
    out += fmt::format("\n[model.elastic]\nstrain = \"{}\"\n", strains[volume::isSmall(law) ? 0 : 1]);
    if (!volume::isSmall(law) && law != volume::Law(volume::NeoHookean{})) {
        out += fmt::format("law = \"{}\"\n", volume::nameOf(law));
    }
    out += writeFields<ElasticSettings>(elasticFields, model.elastic);
    return out;
}

std::string insertText(const Insert& insert)
{
    return fmt::format("\n[[insert]]\n{}centre_mm = {}\n{}seed = {}\n", writeFields<Insert>(insertFields, insert),
                       millimetres(insert.centre), insert.to ? "to_mm = " + millimetres(*insert.to) + "\n" : "",
                       insert.seed);
}

std::string stepText(const TraineeStep& step)
{
    const bool moves = step.kind != TraineeStep::Kind::fire && step.kind != TraineeStep::Kind::wait;
    return fmt::format("\n[[script]]\nkind = \"{}\"\n{}{}", stepKinds[static_cast<std::size_t>(step.kind)],
                       moves ? "to_mm = " + millimetres(step.to) + "\n" : "", writeFields<TraineeStep>(stepFields, step));
}

Scene readScene(const std::string& text, const std::filesystem::path& origin, Names names)
{
    const toml::table root = parseToml(text, origin.string());
    Section top(root, origin.string(), "");
    Scene scene;
    scene.text = text;
    scene.name = top.word("name").value_or(origin.stem().string());
    readVolume(top, origin, scene.source);
    readInserts(top, scene.source.inserts);
    readChoice(top, "task", taskNames, scene.task);
    const auto tissues = top.word("tissues");
    top.refuseIf(tissues && !scene.source.file.empty(), "tissues",
                 "a volume file holds its tissues; give the table to `palpate import --tissues`");
    scene.tissueChanges = readTissueChanges(top);
    readTool(top, scene.tool);
    readModel(top, scene.model);
    readDffb(top, scene.dffb);
    readVital(top, names, scene.vital);
    readTarget(top, names, scene);
    if (std::optional<Section> safety = top.section("safety")) {
        scene.forceCap = safety->number("cap_n", "N", 0.1, 50).value_or(scene.forceCap);
        scene.device = safety->word("device").value_or(scene.device);
        safety->finish();
    }
    readScript(top, scene.script);
    readProbe(top, scene.probe);
    readCt(top, scene.ct);
    readGravity(top, scene.gravity);
    top.refuseIf(scene.ct.given() && scene.probe.kind != ProbeKind::none, "ct",
                 "a scene is guided by ultrasound ([probe]) or by CT ([ct]), not by both");
    top.finish();
    top.missingIf(scene.target.empty() && !scene.aim, "[target]",
                  "structure = \"..\", what to sample, or aim_mm = [x, y, z]");
    if (tissues) {
        scene.tissues = resolved(*tissues, origin).string();
        replaceString(scene.text, root.get("tissues"), scene.tissues);
    }
    if (!scene.source.file.empty()) {
        replaceString(scene.text, root["volume"]["file"].node(), scene.source.file.string());
    }
    return scene;
}

}  // namespace

Scene parseScene(const std::string& text, const std::filesystem::path& origin)
{
    return readScene(text, origin, Names::once);
}

Scene parseRecordedScene(const std::string& text, const std::filesystem::path& origin)
{
    return readScene(text, origin, Names::any);
}

Scene loadScene(const std::filesystem::path& file)
{
    return parseScene(readText(file), file);
}

// Read by itself: the volume of a record's scene may be gone.
SceneAim aimOf(const std::string& sceneText)
{
    SceneAim found;
    try {
        const toml::table root = parseToml(sceneText, "scene");
        Section top(root, "scene", "");
        readChoice(top, "task", taskNames, found.task);
        if (std::optional<Section> tool = top.section("tool")) {
            readChoice(*tool, "kind", toolKinds, found.tool);
        }
    } catch (const std::runtime_error&) {
        return {};
    }
    return found;
}

std::vector<std::string> builtInScenes()
{
    return {"breast",    "us-core-biopsy", "ct-core-biopsy", "near-vessel", "behind-rib",
            "find-lump", "layered",        "block",          "plate",       "pair"};
}

std::optional<Scene> builtInScene(const std::string& name)
{
    const std::string_view text = embeddedFile("scenes/" + name + ".toml");
    return text.empty() ? std::nullopt : std::optional(parseScene(std::string(text), name));
}

std::string volumeText(const Scene& scene)
{
    Scene alone;
    alone.source = scene.source;
    alone.tissues = scene.tissues;
    alone.tissueChanges = scene.tissueChanges;
    return sceneText(alone);
}

std::string sceneText(const Scene& scene)
{
    std::string out = fmt::format("name = {}\n", tomlString(scene.name));
    if (!scene.tissues.empty()) {
        out += fmt::format("tissues = {}\n", tomlString(scene.tissues));
    }
    out += fmt::format("task = \"{}\"\n", taskNames[static_cast<std::size_t>(scene.task)]);
    out += "\n[volume]\n";
    out += scene.source.file.empty() ? phantomText(scene.source.phantom)
                                     : fmt::format("file = {}\n", tomlString(scene.source.file.string()));
    for (const Insert& insert : scene.source.inserts) {
        out += insertText(insert);
    }
    out += tissueChangesText(scene.tissueChanges);
    out += fmt::format("\n[tool]\nkind = \"{}\"\n{}", toolKinds[static_cast<std::size_t>(scene.tool.kind)],
                       writeFields<ToolSpec>(toolFields, scene.tool));
    out += modelText(scene.model);
    out += fmt::format("\n[dffb]\nmode = \"{}\"\n{}", dffbModes[static_cast<std::size_t>(scene.dffb.mode)],
                       writeFields<DffbParameters>(dffbFields, scene.dffb));
    for (const Term& term : terms) {
        out += fmt::format("\n[dffb.{}]\n{}", term.key, writeFields<ForceTerm>(termFields, scene.dffb.*term.member));
    }
    for (const VitalStructure& vital : scene.vital) {
        out += "\n[[vital]]\n" + writeFields<VitalStructure>(vitalFields, vital);
    }
    out += "\n[target]\n";
    out += scene.target.empty() ? "" : fmt::format("structure = {}\n", tomlString(scene.target));
    out += scene.entry ? fmt::format("entry_mm = {}\n", millimetres(*scene.entry)) : "";
    out += scene.aim ? fmt::format("aim_mm = {}\n", millimetres(*scene.aim)) : "";
    out += fmt::format("\n[safety]\ncap_n = {:.12g}\ndevice = {}\n", scene.forceCap, tomlString(scene.device));
    for (const TraineeStep& step : scene.script) {
        out += stepText(step);
    }
    return out + probeText(scene.probe) + ctText(scene.ct) + gravityText(scene.gravity);
}

}  // namespace palpate::datasets
