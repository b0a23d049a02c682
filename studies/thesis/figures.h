#pragma once

#include <studies/thesis/tasks_measure.h>

#include <nlohmann/json.hpp>

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace palpate::studies {

/// What a viewer took beside the events with graphics on.
struct ViewerTimes {
    double setUp = 0;    // G1: from its start to its first picture [s]
    double read = 0;     // G2: from a tick's publishing to the viewer having it, median [s]
    double picture = 0;  // G3: from there to the finished picture, median [s]
    std::size_t pictures = 0;
};

/// One number of objects.
struct TasksCase {
    std::size_t objects = 0;
    std::size_t voxels = 0;
    double build = 0;                // H1: from labels to a session [s]
    std::vector<EventTimes> events;  // ours
    std::vector<EventTimes> loop;    // of the loop over objects
    std::optional<ViewerTimes> viewer;
};

/// Everything that `bench tasks` has measured.
struct TasksResult {
    std::string level;             // of the tissue model
    std::string graphics;          // "measured", or why not
    std::vector<TasksCase> cases;  // by number of objects
};

/// What `bench tasks --json` writes.
nlohmann::json tasksFigures(const TasksResult& result);

/// The tables, for people.
void printTasks(const nlohmann::json& figures);

/// Process time against the number of objects: ours, the loop, the thesis. Throws std::runtime_error.
void writeTasksChart(const nlohmann::json& figures, const std::filesystem::path& png);

/// Writes tasks.json, tasks.png and tasks.html. Throws std::runtime_error.
void writeTasksFolder(const std::filesystem::path& folder, const nlohmann::json& figures);

}  // namespace palpate::studies
