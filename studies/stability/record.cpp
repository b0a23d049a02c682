#include <studies/stability/record.h>

#include <base/error.h>
#include <datasets/scene_text.h>
#include <haptics/recorder.h>
#include <session/open.h>

#include <memory>

namespace palpate::studies {

namespace {

constexpr std::uint64_t ticksPerFlush = 256;

// The scene as a file would have it: its volume is one.
haptics::SessionModel modelIn(const StabilityScene& scene, const std::string& device, datasets::ModelLevel level,
                              const std::filesystem::path& volume)
{
    auto session = scene.session;
    session.model.level = level;
    session.device = device;
    session.source.file = volume;
    auto parsed = datasets::parseScene(datasets::sceneText(session), volume);
    auto tissue = std::make_shared<const volume::Tissue>(datasets::sceneVolume(parsed));
    return haptics::buildModel(std::move(parsed), std::move(tissue));
}

}  // namespace

std::filesystem::path volumeBeside(const std::filesystem::path& record)
{
    base::failIf(record.extension() != ".db", "{}: is no name of a record: it must end in .db", record.native());
    auto volume = std::filesystem::absolute(record).lexically_normal();
    return volume.replace_extension(".vdb");
}

CellResult recordCell(const Cell& cell, const StabilityModels& models, const std::filesystem::path& file)
{
    const auto& scene = models.scene(cell.scene);
    const auto& method = models.method(cell.method);
    const auto volume = volumeBeside(file);
    for (const auto& there : {file, volume}) {
        base::failIf(std::filesystem::exists(there), "{}: exists already; choose another name or remove it",
                     there.native());
    }
    scene.tissue->save(volume);
    const auto model = modelIn(scene, cell.device, method.level, volume);
    auto info = session::describeSession(model, volume.string(), cell.device);
    info.rate = cell.rate;
    info.extra.emplace_back("stability_cell", cell.id());
    haptics::Recorder recorder(file, info);
    std::uint64_t ticks = 0;
    const Trace trace = runSession(cell, scene, method, model,
                                   [&](const haptics::DeviceSample& sample, Vec3 force, const RunningMethod& running) {
                                       haptics::TickRecord record;
                                       if (running.record) {
                                           record = *running.record();
                                       } else {
                                           record.tick = ticks;
                                           record.device = sample;
                                           record.proxy = sample.position;
                                           record.basic = record.total = force;
                                       }
                                       recorder.push(record);
                                       if (++ticks % ticksPerFlush == 0) {
                                           recorder.flush();
                                       }
                                   });
    recorder.finish({});
    if (!recorder.error().empty()) {
        throw base::error("{}: {}", file.string(), recorder.error());
    }
    const Bounded bounded = cell.held ? scene.held : scene.released;
    return {cell, bounded, figureOf(bounded.figure, trace, scene)};
}

}  // namespace palpate::studies
